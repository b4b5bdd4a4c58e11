"""A clinic's rows as they travel: the same on every database, and on both sides of a move."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import msgspec
from cryptography.fernet import InvalidToken
from django.contrib.auth.hashers import UNUSABLE_PASSWORD_PREFIX
from django.db.models import Model, Q, QuerySet

from rehab.exports.clinic.clinic_models import Table, clinic_paths, moving_tables
from rehab.people.audit.moves import ClinicMove, Translate, same_key
from rehab.people.audit.row_digests import with_floats
from rehab.people.commands import command
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.people.server_keys import Purpose, decrypt_text, encrypt_text
from rehab.people.sign_in.factors.factors import Authenticator

READ_ROWS = 2000
TOKENS = ("token_hash", "successor_hash", "retired_hash")
to_json = msgspec.json.Encoder(order="sorted").encode


class CannotMove(ValueError):
    """A clinic that cannot be taken out, in or away; the message says why, and what to do."""


# Columns that are encrypted with a server's own keys.
ENCRYPTED = {
    "rehab.study": ("sealed", Purpose.STUDIES),
    "rehab.authenticator": ("credential", Purpose.AUTHENTICATORS),
    "rehab.endpoint": ("secret", Purpose.RECEIVERS),  # which stays where it is
}


def open_value(label: str, encrypted: str) -> str:
    """Return an encrypted value as it travels. Raises CannotMove for a study of another key."""
    try:
        return decrypt_text(ENCRYPTED[label][1], encrypted) if encrypted else ""
    except InvalidToken as problem:
        if label == "rehab.study":
            raise CannotMove(
                f"A study was sealed with another key of the server. Run {command('rotatekeys')}."
            ) from problem
        return ""  # an app whose codes are refused here, too


def close_value(label: str, text: str) -> str:
    """Return a value, encrypted with this server's key."""
    return encrypt_text(ENCRYPTED[label][1], text) if text else ""


def is_encrypted(table: Table, row: list[Any]) -> bool:
    """Return whether a row has a value that is encrypted with the server's own key."""
    if table.label == Authenticator._meta.label_lower:
        return bool(row[table.index("kind")] == Authenticator.Kind.APP)
    return table.label in ENCRYPTED


@dataclass
class ClinicRows:
    """The rows of a clinic, read from this installation.

    Attributes
    ----------
    with_tokens
        Whether the hashes of tokens are among them; else they are empty.
    move
        The move by which it came here, to read the rows as they were before; None: as they are.
    """

    clinic_id: int
    with_tokens: bool = False
    move: ClinicMove | None = None
    counts: dict[str, int] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)

    @cached_property
    def outsiders(self) -> set[int]:
        """Accounts of hosts and of other clinics that did something here: they go along, empty."""
        found: set[int] = set()
        for table in moving_tables():
            for one in table.fields:
                if one.related_model is User:
                    others = self.rows_of(table.model).filter(**{f"{one.name}__isnull": False})
                    others = others.exclude(**{f"{one.name}__clinic": self.clinic_id})
                    found |= set(others.order_by().values_list(one.attname, flat=True).distinct())
        return found

    def rows_of(self, model: type[Model]) -> QuerySet[Any]:
        """Return the clinic's rows of a model."""
        rows = Q(**{clinic_paths()[model]: self.clinic_id})
        if self.move is not None:
            copied = self.move.shared.get("copied", {})
            if model is ClinicMove:
                rows &= ~Q(pk=self.move.pk)
            rows &= ~Q(pk__in=copied.get(model._meta.label_lower, []))
            if model._meta.label_lower == "rehab.protocolphase":
                rows &= ~Q(protocol__in=copied.get("rehab.protocol", []))
        return model._base_manager.filter(rows)

    def read(self, table: Table) -> Iterator[list[Any]]:
        """Yield a table's rows as they travel."""
        rows = self.rows_of(table.model)
        if table.model is User and self.move is None:
            rows = User.everywhere.filter(Q(clinic=self.clinic_id) | Q(pk__in=self.outsiders))
        translate: Translate = same_key if self.move is None else self.move.old_key
        renamed = {} if self.move is None else self.move.renamed
        changes = self._changes_of(table, renamed)
        for values in (
            rows.order_by(*table.order()).values_list(*table.names).iterator(chunk_size=READ_ROWS)
        ):
            row = list(values)
            if table.model is User and row[table.index("clinic_id")] != self.clinic_id:
                self._empty_account(table, row)
            for index, change in changes:
                row[index] = change(row[index])
            if is_encrypted(table, row):
                place = table.index(ENCRYPTED[table.label][0])
                row[place] = open_value(table.label, row[place])
            if self.move is not None:
                table.translate(row, translate)
            yield row

    def _changes_of(
        self, table: Table, renamed: dict[str, dict[str, str]]
    ) -> list[tuple[int, Callable[[Any], Any]]]:
        """Return by the places of columns what becomes of them: tokens, and what was renamed."""
        changes: list[tuple[int, Callable[[Any], Any]]] = []
        if not self.with_tokens:
            changes += [(n, lambda _: "") for n, name in enumerate(table.names) if name in TOKENS]
        if table.model is Clinic:
            changes.append((table.index("removing_at"), lambda _: None))
        for where, names in renamed.items():
            label, _, column = where.rpartition(".")
            if label == table.label:
                before = {new: old for old, new in names.items()}
                changes.append((table.index(column), partial(_renamed, before)))
        return changes

    def _empty_account(self, table: Table, row: list[Any]) -> None:
        """Leave of an account of elsewhere who it was: it signs in nowhere, and has no rights."""
        row[table.index("clinic_id")] = self.clinic_id
        row[table.index("role")] = Role.RESEARCHER.value
        row[table.index("password")] = UNUSABLE_PASSWORD_PREFIX
        row[table.index("email")] = ""
        row[table.index("is_active")] = False

    def lines(self) -> Iterator[bytes]:
        """Yield each table's name, then its rows; counts and digests are filled in."""
        for table in moving_tables():
            yield to_json({"model": table.label, "columns": table.names})
            count, digest = 0, Digest(table)
            for row in self.read(table):
                count += 1
                line = to_json(row)
                digest.add(row, line)
                yield line
            self.counts[table.label], self.digests[table.label] = count, digest.text

    def count(self) -> dict[str, int]:
        """Return the number of rows of each table."""
        return {table.label: self.rows_of(table.model).count() for table in moving_tables()}

    def digest(self, *labels: str) -> dict[str, str]:
        """Return the digests of these tables; of all without names."""
        found: dict[str, str] = {}
        for table in moving_tables():
            if not labels or table.label in labels:
                digest = Digest(table)
                for row in self.read(table):
                    digest.add(row, to_json(row))
                found[table.label] = digest.text
        return found


def _renamed(names: dict[str, str], now: str | None) -> str | None:
    return None if now is None else names.get(now, now)


class Digest:
    """The digest of a table's rows, the same from every database."""

    def __init__(self, table: Table) -> None:
        self._json, self._sum = table.json, hashlib.sha256()

    def add(self, row: list[Any], line: bytes) -> None:
        """Add a row, and the line that it is in the file."""
        if self._json:  # databases write the same number in different ways
            row = row.copy()
            for n in self._json:
                row[n] = with_floats(row[n])
            line = to_json(row)
        self._sum.update(line + b"\n")

    @property
    def text(self) -> str:
        """The digest so far."""
        return self._sum.hexdigest()


def shared_references(clinic_id: int) -> dict[str, list[int]]:
    """Return the keys of the rows of all clinics that a clinic's rows refer to, by model."""
    found: dict[str, set[int]] = {}
    rows = ClinicRows(clinic_id)
    for table in moving_tables():
        for one in table.fields:
            related = one.related_model
            if related is None or related is table.model or not _is_shared(related):
                continue
            lookup = f"{one.name}__{clinic_paths()[related]}__isnull"
            used = rows.rows_of(table.model).filter(**{lookup: True, f"{one.name}__isnull": False})
            keys = used.order_by().values_list(one.attname, flat=True).distinct()
            found.setdefault(related._meta.label_lower, set()).update(keys)
    return {label: sorted(keys) for label, keys in found.items() if keys}


def _is_shared(model: type[Model]) -> bool:
    return bool(getattr(getattr(model, "scope", None), "shared", False))
