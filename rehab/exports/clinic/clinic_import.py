"""Takes a clinic in from a sealed file: beside running sessions, all of it or nothing.

The file is read twice: first as a whole, so that a damaged one touches nothing; then in small
transactions with pauses, so that sessions of other clinics do not wait. Until all is compared
nobody can sign in to the clinic and none of its tokens is valid.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from datetime import datetime
from functools import partial
from itertools import count, groupby
from pathlib import Path
from typing import Any, BinaryIO

from django.db import connection, transaction
from django.db.models import DateField, DateTimeField, TimeField
from pyrage.x25519 import Identity

from rehab.exports.clinic.clinic_models import STAYS, Table, clinic_paths, moving_tables
from rehab.exports.clinic.clinic_removal import delete_rows, transaction_and_rest
from rehab.exports.clinic.primary_keys import reserve_keys
from rehab.exports.clinic.row_serialization import (
    ENCRYPTED,
    TOKENS,
    CannotMove,
    ClinicRows,
    close_value,
    is_encrypted,
)
from rehab.exports.clinic.sealed_file import (
    PSEUDONYMS,
    Content,
    decode_part,
    inspect,
    read_parts,
)
from rehab.exports.clinic.shared_rows import place_shared
from rehab.people.aliases import draw_alias
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.audit.moves import ClinicMove
from rehab.people.commands import command
from rehab.people.models import Clinic, Patient, User
from rehab.people.sign_in.tokens import draw_token, hash_token
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.ownership import ClinicOwner
from rehab.sessions.setup.recordings import recordings_folder

BATCH_ROWS = 100
USER, CLINIC = User._meta.label_lower, Clinic._meta.label_lower


class Arrival:
    """One import. ``log`` is called with what people should know of it."""

    def __init__(self, content: Content, now: datetime, log: Callable[[str], None]) -> None:
        self._content, self._now, self._log = content, now, log
        self.move = ClinicMove()
        self._closed: dict[str, list[Any]] = {}  # rows that come in at the end
        self._active: list[int] = []
        self._boards_across = False

    def load(self, file: BinaryIO, identities: Sequence[Identity], name: str) -> Clinic:
        """Store a clinic's rows and recordings; return it, open to its people.

        Raises CannotMove, and whatever the database raises; nothing is left then.
        """
        header = self._content.header
        key, shared = self._begin(header, name)
        try:
            parts = read_parts(file, identities)
            next(parts)
            self._store(parts, key, shared)
            self._compare([one.label for one in moving_tables() if one.label not in self._late()])
            self._open(key)
        except BaseException:
            delete_rows(key)
            raise
        return Clinic.everywhere.get(pk=key)

    def _begin(self, header: dict[str, Any], name: str) -> tuple[int, dict[str, Any]]:
        """Reserve keys, and store what the first rows refer to."""
        renamed = self._rename(name or header["clinic"])
        with transaction.atomic():
            shifts = reserve_keys(connection, header["last_keys"])
        key = header["key"] + shifts[CLINIC]
        self.move = ClinicMove(
            clinic_id=key,
            number=self._content.counts[ClinicMove._meta.label_lower] + 1,
            file=header["file"],
            exported_at=header["made_at"],
            at=self._now,
            shifts=shifts,
            renamed=renamed,
            digests=self._content.digests,
        )
        return key, header["shared"]

    def _rename(self, name: str) -> dict[str, dict[str, str]]:
        """Return new values for those that are taken here, by column. Raises CannotMove."""
        header, names = self._content.header, self._content.names
        if Clinic.everywhere.filter(name=name).exists():
            raise CannotMove(f"A clinic {name} is here already. Give another name by --name.")
        here = Patient.everywhere.filter(pseudonym__in=names[PSEUDONYMS]).select_related("clinic")
        if (patient := here.first()) is not None:
            raise CannotMove(
                f"Patients of the file are here already, in {patient.clinic}: the clinic was taken "
                "in from another file, or never left. Remove that one first, or leave it as it is."
            )
        renamed: dict[str, dict[str, str]] = {f"{CLINIC}.name": {header["clinic"]: name}}
        accounts, coming = {}, {one.lower() for one in names.get(f"{USER}.username", [])}
        for taken in names.get(f"{USER}.username", []):
            if User.is_taken(taken):
                accounts[taken] = _free_name(taken, coming)
                coming.add(accounts[taken].lower())
                self._log(f"The account {taken} is {accounts[taken]} here: the name is taken.")
        aliases, drawn = {}, set(names.get("rehab.patient.alias", []))
        for alias in names.get("rehab.patient.alias", []):
            if Patient.everywhere.filter(alias=alias).exists():
                aliases[alias] = draw_alias(
                    lambda one: one in drawn or Patient.everywhere.filter(alias=one).exists()
                )
                drawn.add(aliases[alias])
        if aliases:
            self._log(f"{len(aliases)} patient(s) have another animal name here: theirs is taken.")
        return renamed | {f"{USER}.username": accounts, "rehab.patient.alias": aliases}

    def _late(self) -> set[str]:
        """Return the tables that are compared at the end: who may come in, and by what."""
        tokens = {one.label for one in moving_tables() if set(TOKENS) & set(one.names)}
        return tokens | {USER, CLINIC}

    def _store(self, parts: Iterator[tuple[Any, Any]], key: int, shared: Any) -> None:
        tables = {one.label: one for one in moving_tables()}
        renamed = {
            where.rpartition(".")[0]: (where.rpartition(".")[2], names)
            for where, names in self.move.renamed.items()
        }
        for label, rows in groupby(parts, lambda part: part[0].get("model", "")):
            values = (row for _, row in rows if row is not None)
            if not label:
                continue
            table = tables[label]
            changed = (self._local(table, row, *renamed.get(label, ("", {}))) for row in values)
            if label in self._late() - {USER, CLINIC}:
                self._closed[label] = list(changed)
                continue
            insert_in_batches(table, changed)
            if label == CLINIC:
                self._place(key, shared)

    def _place(self, key: int, shared: Any) -> None:
        """Store the move, and what takes the place of rows of all clinics. No server has it."""
        with transaction.atomic():
            self.move.shared = place_shared(shared, key, self.move.shifts)
            self.move.save()
            ClinicOwner.everywhere.create(pk=key, owner=clinic_owners.own_name())

    def _local(self, table: Table, row: list[Any], column: str, names: dict[str, str]) -> list[Any]:
        """Return a row of the file as it is stored here. Raises CannotMove for another's row."""
        key = self._content.header["key"]
        if clinic_paths()[table.model] in ("pk", "clinic"):
            own = row[table.index("id" if table.label == CLINIC else "clinic_id")]
            if own != key or (table.label == USER and row[table.index("is_superuser")]):
                raise CannotMove("Rows of the file are not of its clinic. Export it again.")
        if is_encrypted(table, row):
            place = table.index(ENCRYPTED[table.label][0])
            row[place] = close_value(table.label, row[place])
        if column:
            row[table.index(column)] = names.get(row[table.index(column)], row[table.index(column)])
        if "token_hash" in table.names and not row[table.index("token_hash")]:
            row[table.index("token_hash")] = hash_token(draw_token())  # nobody has it
        table.translate(row, self._new_key)
        if table.label == USER and row[table.index("is_active")]:
            self._active.append(row[table.index("id")])
            row[table.index("is_active")] = False
        if table.label == CLINIC:
            self._boards_across = row[table.index("boards_across")]
            row[table.index("boards_across")] = False
        return row

    def _new_key(self, model: type[Any], key: int) -> int:
        """Return a row's key here: one of those that are reserved. Raises CannotMove for others."""
        label = model._meta.label_lower
        if label in STAYS:  # its history alone came along, and names it as it was
            return key
        if not 0 <= key <= self._content.header["last_keys"].get(label, 0):
            raise CannotMove(
                f"The file has a key beyond its own ({label} {key}). Export the clinic again."
            )
        return self.move.new_key(model, key)

    def _compare(self, labels: Sequence[str]) -> None:
        """Raise CannotMove where the stored rows are not those of the file."""
        rows = ClinicRows(self.move.clinic_id, self._content.header["tokens"], self.move)
        found = rows.digest(*labels)
        wrong = [label for label in labels if found[label] != self._content.digests[label]]
        if wrong:
            raise CannotMove(
                f"What was stored is not what the file says ({', '.join(wrong)}). Nothing was left "
                f"here. Look for damage of disk and database ({command('doctor')}), then "
                "try again."
            )

    def _open(self, key: int) -> None:
        """Let the clinic's people in, in one transaction, if all is as the file says."""
        with transaction.atomic():
            for label, rows in self._closed.items():
                table = next(one for one in moving_tables() if one.label == label)
                _insert(table, rows)
            Clinic.everywhere.filter(pk=key).update(boards_across=self._boards_across)
            User.everywhere.filter(pk__in=self._active).update(is_active=True)
            self._compare(sorted(self._late()))
            ClinicMove.everywhere.filter(pk=self.move.pk).update(finished_at=self._now)
            ClinicOwner.everywhere.filter(pk=key).update(owner="")
            about = command(f"clinic import, file {self.move.file}")
            audit_log.record(Act.CLINIC_IN, None, clinic_id=key, about=about, now=self._now)


def import_clinic(
    file: BinaryIO,
    identities: Sequence[Identity],
    now: datetime,
    *,
    name: str = "",
    log: Callable[[str], None] = print,
) -> Clinic:
    """Take a clinic in; return it. Raises CannotDecrypt and CannotMove; nothing is left then."""
    content = inspect(file, identities)
    earlier = ClinicMove.everywhere.filter(file=content.header["file"], clinic__removing_at=None)
    for move in earlier.select_related("clinic"):
        if move.finished_at is not None:
            raise CannotMove(
                f"This file was taken in on {move.at:%Y-%m-%d}, as {move.clinic}. Use that clinic, "
                "or remove it first."
            )
        owner = ClinicOwner.everywhere.filter(pk=move.clinic_id).values_list("owner", flat=True)
        if (other := owner.first()) and clinic_owners.is_alive(other):
            raise CannotMove("This file is being taken in just now. Wait until that has ended.")
        delete_rows(move.clinic_id)  # of an import that was interrupted
    clinic = Arrival(content, now, log).load(file, identities, name)
    for lost in _store_recordings(file, identities):
        log(f"The recording {lost} was not stored: there is another one of that name.")
    return clinic


def _free_name(username: str, coming: Collection[str]) -> str:
    """Return a name for an account that nobody has here, and none that comes in."""
    for number in count(2):
        name = f"{username[:140]}.{number}"
        if name.lower() not in coming and not User.is_taken(name):
            break
    return name


def insert_in_batches(table: Table, rows: Iterator[list[Any]]) -> None:
    """Store rows in small transactions, and rest between them."""
    batch: list[list[Any]] = []
    for row in rows:
        batch.append(row)
        if len(batch) >= BATCH_ROWS:
            _insert_and_rest(table, batch)
            batch = []
    if batch:
        _insert_and_rest(table, batch)


def _insert_and_rest(table: Table, rows: list[list[Any]]) -> None:
    with transaction_and_rest():
        _insert(table, rows)


def _insert(table: Table, rows: list[list[Any]]) -> None:
    """Insert rows with their keys."""
    if not rows:
        return
    stored = [partial(field.get_db_prep_save, connection=connection) for field in table.fields]
    parsed = [_parser(field) for field in table.fields]
    values = [
        [
            store(parse(value) if parse is not None and value is not None else value)
            for store, parse, value in zip(stored, parsed, row, strict=True)
        ]
        for row in rows
    ]
    columns = ", ".join(f'"{field.column}"' for field in table.fields)
    name = table.model._meta.db_table
    with connection.cursor() as cursor:
        if connection.vendor == "postgresql":
            with cursor.copy(f"COPY {name} ({columns}) FROM STDIN") as copy:
                for row in values:
                    copy.write_row(row)
            return
        marks = ", ".join(["%s"] * len(table.fields))
        cursor.executemany(f"INSERT INTO {name} ({columns}) VALUES ({marks})", values)  # noqa: S608


def _parser(field: Any) -> Callable[[Any], Any] | None:
    """Return what makes a field's value of its text in the file; None where that is the value."""
    parses = isinstance(field, DateTimeField | DateField | TimeField)
    return field.to_python if parses else None


def _store_recordings(file: BinaryIO, identities: Sequence[Identity]) -> Iterator[str]:
    """Store the recordings of a file; yield the names of those that others have."""
    folder = recordings_folder()
    for name, parts in groupby(
        read_parts(file, identities), lambda part: part[0].get("recording", "")
    ):
        content = (decode_part(row) for _, row in parts if row is not None)
        if not name or Path(name).name != name or name.startswith("."):
            for _ in parts:
                pass
            continue
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        new = folder / f".{name}.new"
        with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as out:
            for part in content:
                out.write(part)
        with suppress(FileExistsError):
            (folder / name).hardlink_to(new)
        is_same = (folder / name).read_bytes() == new.read_bytes()
        new.unlink()
        if not is_same:
            yield name
