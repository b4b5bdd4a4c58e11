"""Backup and restore of a whole installation as one file, between SQLite and PostgreSQL too.

The content is lines of JSON, compressed by gzip and encrypted by age: a header with the version of
the tables and the count of rows, then every row. `age -d -i KEY FILE | gunzip` prints them.
"""

from __future__ import annotations

import gzip
import json
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from itertools import islice
from typing import Any, BinaryIO

from django.apps import apps
from django.core import serializers
from django.core.management.color import no_style
from django.core.serializers.json import DjangoJSONEncoder
from django.db import connection, models, transaction
from django.db.migrations.recorder import MigrationRecorder
from pyrage.x25519 import Identity, Recipient

from rehab.exports.encryption import decrypt, encrypt
from rehab.people.audit import append_only_triggers
from rehab.people.models import User

FORMAT = 1
# Rows that each installation creates itself, and those of this installation's browsers.
EXCLUDED_MODELS = {
    "admin.logentry",  # refers to content types, which each installation numbers by itself
    "auth.permission",
    "contenttypes.contenttype",
    "rehab.pairing",
    "sessions.session",
}
BATCH_ROWS = 2000  # rows held in memory
GZIP_WBITS = 31  # makes zlib write the gzip format


class CannotRestore(ValueError):
    """A backup that cannot be restored; the message says why, and what to do."""


class ExactEncoder(DjangoJSONEncoder):
    """Writes moments to the microsecond, as digests have them; Django's own to the millisecond."""

    def default(self, value: Any) -> Any:
        """Return a value as JSON has it."""
        return value.isoformat() if isinstance(value, datetime) else super().default(value)


def backup_models() -> list[type[models.Model]]:
    """Return the models of a backup, including those of many-to-many tables."""
    candidates = apps.get_models(include_auto_created=True)
    return sorted(filter(_is_included, candidates), key=lambda model: model._meta.label_lower)


def _is_included(model: type[models.Model]) -> bool:
    fields = model._meta.concrete_fields
    joined = [field.related_model._meta for field in fields if field.related_model]
    return (
        model._meta.managed
        and not model._meta.proxy
        and EXCLUDED_MODELS.isdisjoint(meta.label_lower for meta in (model._meta, *joined))
    )


def tables_version() -> list[list[str]]:
    """Return the migrations that are applied to this installation's tables."""
    return sorted(list(name) for name in MigrationRecorder(connection).applied_migrations())


@contextmanager
def consistent_read() -> Iterator[None]:
    """Read a consistent snapshot of the database in this block, without blocking writers."""
    if connection.in_atomic_block:
        yield
    elif connection.vendor == "postgresql":
        with transaction.atomic(), connection.cursor() as cursor:
            cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
            yield
    else:
        # Not atomic(): that would take SQLite's only write lock.
        with connection.cursor() as cursor:
            cursor.execute("BEGIN DEFERRED")
            try:
                yield
            finally:
                cursor.execute("ROLLBACK")


def write_backup(file: BinaryIO, recipients: Sequence[Recipient], now: datetime) -> dict[str, int]:
    """Write a backup into a file; return the number of rows of each model."""
    counts: dict[str, int] = {}
    with consistent_read():
        encrypt(_compress(_lines(counts, now)), file, recipients)
    return counts


def _lines(counts: dict[str, int], now: datetime) -> Iterator[str]:
    """Yield the header, then every row. Counts are filled in."""
    included_models = backup_models()
    counts.update(
        {model._meta.label_lower: model._base_manager.count() for model in included_models}
    )
    header = {"format": FORMAT, "made_at": now.isoformat(), "tables": tables_version()}
    yield json.dumps(header | {"counts": counts}) + "\n"
    for model in included_models:
        names = [field.name for field in model._meta.concrete_fields]
        rows = model._base_manager.order_by("pk").iterator(chunk_size=BATCH_ROWS)
        while batch := list(islice(rows, BATCH_ROWS)):
            yield serializers.serialize("jsonl", batch, fields=names, cls=ExactEncoder)


def _compress(texts: Iterable[str]) -> Iterator[bytes]:
    compressor = zlib.compressobj(wbits=GZIP_WBITS)
    for text in texts:
        yield compressor.compress(text.encode())
    yield compressor.flush()


def read_lines(file: BinaryIO, identities: Sequence[Identity]) -> Iterator[str]:
    """Yield a backup's lines. Raises CannotDecrypt."""
    with decrypt(file, identities) as content, gzip.open(content, "rt", encoding="utf-8") as lines:
        yield from lines


def restore_backup(file: BinaryIO, identities: Sequence[Identity]) -> dict[str, int]:
    """Restore a backup into an unused installation; return the number of rows of each model.

    Restores all of it or nothing. Raises CannotDecrypt and CannotRestore.
    """
    if User.everywhere.exists():
        raise CannotRestore(
            "This installation has accounts already. Restore into a new one: an empty "
            "GARRY_DATA_DIR, or an empty database."
        )
    lines = read_lines(file, identities)
    header = json.loads(next(lines))
    if header["format"] != FORMAT or header["tables"] != tables_version():
        raise CannotRestore(
            f"The backup was made on {header['made_at'][:10]} by another version of GARRY. Install "
            "that version, restore, and then update."
        )
    included_models = backup_models()
    with transaction.atomic(), append_only_triggers.lifted(connection.alias):
        for model in included_models:  # migrations have created measures and protocols
            model._base_manager.all()._raw_delete(connection.alias)  # noqa: SLF001
        for row in serializers.deserialize("jsonl", lines):
            row.save(save_m2m=False, force_insert=True)
        counts = {model._meta.label_lower: model._base_manager.count() for model in included_models}
        if counts != header["counts"]:
            raise CannotRestore("Rows are missing. Take another copy of the backup.")
        with connection.cursor() as cursor:
            for statement in connection.ops.sequence_reset_sql(no_style(), included_models):
                cursor.execute(statement)
    return counts
