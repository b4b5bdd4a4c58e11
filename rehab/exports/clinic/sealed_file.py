"""The sealed file of a clinic: lines of JSON, compressed by gzip, encrypted by age.

A header; of each table its columns and rows; the recordings that its sessions name; at last counts
and digests. `age -d -i KEY FILE | gunzip` prints it.
"""

from __future__ import annotations

import gzip
import zlib
from base64 import b64decode, b64encode
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO
from uuid import uuid4

import msgspec
from django.db import connection
from pyrage.x25519 import Identity, Recipient

from rehab.exports.backup import GZIP_WBITS, consistent_read, tables_version
from rehab.exports.clinic.clinic_models import moving_tables
from rehab.exports.clinic.primary_keys import last_keys
from rehab.exports.clinic.row_serialization import CannotMove, ClinicRows, Digest, to_json
from rehab.exports.clinic.shared_rows import describe_shared
from rehab.exports.encryption import CannotDecrypt, decrypt, encrypt
from rehab.people.audit import seals
from rehab.people.commands import command
from rehab.people.models import Clinic
from rehab.sessions.models import TrainingSession
from rehab.sessions.seals import seal_sessions
from rehab.sessions.setup.recordings import recordings_folder
from rehab.training.changes import State

FORMAT = "garry clinic 1"
PART_BYTES = 600_000  # of a recording in a line
TRIES = 5
COMPRESS_BYTES = 256_000
Names = dict[str, list[str]]
from_json = msgspec.json.Decoder().decode


@dataclass(frozen=True)
class Content:
    """What a file says about itself: its header and its end."""

    header: dict[str, Any]
    counts: dict[str, int]
    digests: dict[str, str]
    names: Names  # of columns whose values may be taken elsewhere


# Columns that are unique in an installation.
UNIQUE = {
    "rehab.user": "username",
    "rehab.patient": "alias",
}
PSEUDONYMS = "rehab.patient.pseudonym"


def check_no_session_runs(clinic: Clinic) -> None:
    """Raise CannotMove while a session of a clinic runs."""
    running = TrainingSession.everywhere.filter(clinic=clinic, state=State.RUNNING.value)
    numbers = ", ".join(map(str, running.order_by("pk").values_list("pk", flat=True)[:10]))
    if numbers:
        raise CannotMove(
            f"In {clinic} sessions run ({numbers}). End or pause them on their pages, then try "
            "again."
        )


def write_clinic(
    clinic: Clinic,
    file: BinaryIO,
    recipients: Sequence[Recipient],
    now: datetime,
    *,
    with_tokens: bool = False,
) -> ClinicRows:
    """Write a clinic into a sealed file; return its rows, with counts and digests.

    Raises CannotMove while sessions run, and where people do not stop working in it.
    """
    for _ in range(TRIES):
        check_no_session_runs(clinic)
        seal_everything(clinic, now)
        with consistent_read():
            check_no_session_runs(clinic)
            if _has_unsealed(clinic):
                continue
            rows = ClinicRows(clinic.pk, with_tokens)
            encrypt(_compress(_lines(clinic, rows, now)), file, recipients)
            return rows
    raise CannotMove(
        f"People go on working in {clinic}: its logs grow while they are read. Let them close "
        "their pages, then try again."
    )


def seal_everything(clinic: Clinic, now: datetime) -> None:
    """Seal all steps, events and logs of a clinic."""
    chosen = TrainingSession.everywhere.filter(clinic=clinic).values("pk")
    seal_sessions(now, pk_in(chosen))
    seals.seal_at_once(clinic.pk, now)


def pk_in(rows: Any) -> Any:
    """Return the condition that a row is among some."""
    from django.db.models import Q

    return Q(pk__in=rows)


def _has_unsealed(clinic: Clinic) -> bool:
    logs = seals.sealed_models()
    return any(seals.unsealed_rows(log, clinic.pk).exists() for log in logs)


def _lines(clinic: Clinic, rows: ClinicRows, now: datetime) -> Iterator[bytes]:
    yield to_json(
        {
            "format": FORMAT,
            "file": uuid4().hex,
            "made_at": now,
            "tables": tables_version(),
            "clinic": clinic.name,
            "key": clinic.pk,
            "tokens": rows.with_tokens,
            "last_keys": last_keys(connection),
            "shared": describe_shared(clinic.pk),
        }
    )
    yield from rows.lines()
    for path in recordings_of(clinic):
        yield to_json({"recording": path.name})
        with path.open("rb") as opened:
            while part := opened.read(PART_BYTES):
                yield to_json([b64encode(part).decode()])
    yield to_json({"counts": rows.counts, "digests": rows.digests})


def recordings_of(clinic: Clinic) -> list[Path]:
    """Return the recordings that a clinic's sessions were walked from, as far as they are there."""
    named = TrainingSession.everywhere.filter(clinic=clinic, source__startswith="recording ")
    sources = named.order_by().values_list("source", flat=True).distinct()
    names = {source.removeprefix("recording ") for source in sources}
    paths = [recordings_folder() / name for name in sorted(names) if Path(name).name == name]
    return [path for path in paths if path.is_file()]


def _compress(lines: Iterable[bytes]) -> Iterator[bytes]:
    compressor, waiting = zlib.compressobj(wbits=GZIP_WBITS), bytearray()
    for line in lines:
        waiting += line + b"\n"
        if len(waiting) >= COMPRESS_BYTES:
            yield compressor.compress(bytes(waiting))
            waiting.clear()
    yield compressor.compress(bytes(waiting)) + compressor.flush()


@contextmanager
def _open_lines(file: BinaryIO, identities: Sequence[Identity]) -> Iterator[Iterator[bytes]]:
    file.seek(0)
    with decrypt(file, identities) as content, gzip.open(content, "rb") as lines:
        yield iter(lines)


def read_parts(
    file: BinaryIO, identities: Sequence[Identity]
) -> Iterator[tuple[dict[str, Any], Any]]:
    """Yield the header with None, then each row with its table, or each part of a recording.

    At last the end with None. Raises CannotDecrypt.
    """
    with _open_lines(file, identities) as lines:
        part: dict[str, Any] = {}
        for line in lines:
            try:
                found = from_json(line)
            except msgspec.DecodeError as problem:
                raise _not_a_clinic() from problem
            if isinstance(found, dict):
                part = found
                yield part, None
            else:
                yield part, found


def _not_a_clinic() -> CannotMove:
    return CannotMove(
        f"It holds no clinic. Choose a file of `{command('clinic export')}`; a backup of the whole "
        f"installation is read by `{command('restore')}`."
    )


def inspect(file: BinaryIO, identities: Sequence[Identity]) -> Content:
    """Return what a file says, once all of it was read and compared with its digests.

    Raises CannotDecrypt and CannotMove.
    """
    header: dict[str, Any] = {}
    end: dict[str, Any] = {}
    tables = {table.label: table for table in moving_tables()}
    sums = {label: Digest(table) for label, table in tables.items()}
    counts = dict.fromkeys(tables, 0)
    names: Names = {PSEUDONYMS: []}
    for part, row in read_parts(file, identities):
        if not header:
            header = check_header(part)
        elif row is None:
            end = part
        elif "model" in part:
            label = part["model"]
            if part["columns"] != tables[label].names:
                raise _not_a_clinic()
            counts[label] += 1
            sums[label].add(row, to_json(row))
            _note_names(tables[label].names, label, row, names)
    if "digests" not in end:
        raise CannotDecrypt("It is damaged or was cut off. Take another copy.")
    digests = {label: one.text for label, one in sums.items()}
    if (counts, digests) != (end["counts"], end["digests"]):
        raise CannotMove("Its rows are others than its digests say. Take another copy.")
    return Content(header, counts, digests, names)


def _note_names(columns: list[str], label: str, row: list[Any], names: Names) -> None:
    if label in UNIQUE and (value := row[columns.index(UNIQUE[label])]) is not None:
        names.setdefault(f"{label}.{UNIQUE[label]}", []).append(value)
    if label == "rehab.patient":
        names[PSEUDONYMS].append(row[columns.index("pseudonym")])


def check_header(header: dict[str, Any]) -> dict[str, Any]:
    """Return a header that this installation can read. Raises CannotMove."""
    if header.get("format") != FORMAT:
        raise _not_a_clinic()
    if header["tables"] != tables_version():
        raise CannotMove(
            f"The file was made on {header['made_at'][:10]} by another version of GARRY. Bring "
            "both installations to the same version, and export the clinic again."
        )
    return header


def decode_part(row: list[str]) -> bytes:
    """Return a part of a recording."""
    return b64decode(row[0])
