"""A whole installation as one file, and back: on SQLite or PostgreSQL, whichever it came from.

The content is lines of JSON, compressed and sealed: a header with the version of the tables and the
count of rows, then every row.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import BinaryIO

from django.apps import apps
from django.core import serializers
from django.core.management.color import no_style
from django.db import connection, models, transaction
from django.db.migrations.recorder import MigrationRecorder

from rehab.exports.sealed import Sealer, unseal
from rehab.people.models import User

FORMAT = 1
# What a server makes anew, or what only the browsers of this one hold the other end of.
LEFT_OUT = {
    "admin.logentry",  # points at content types, which each installation numbers by itself
    "auth.permission",
    "contenttypes.contenttype",
    "rehab.pairing",
    "sessions.session",
}
APPS_LEFT_OUT = {"axes"}  # who failed to sign in, for some hours
A_TIME = 2000  # rows held in memory


class CannotRestore(ValueError):
    """A backup that cannot be taken in; the message says why, and what to do."""


def backed_up() -> list[type[models.Model]]:
    """Give the models of a backup, those that only join two others among them."""
    every = apps.get_models(include_auto_created=True)
    return sorted(filter(_is_kept, every), key=lambda model: model._meta.label_lower)


def _is_kept(model: type[models.Model]) -> bool:
    fields = model._meta.concrete_fields
    joined = [field.related_model._meta for field in fields if field.related_model]
    return (
        model._meta.managed
        and not model._meta.proxy
        and model._meta.app_label not in APPS_LEFT_OUT
        and LEFT_OUT.isdisjoint(meta.label_lower for meta in (model._meta, *joined))
    )


def tables_version() -> list[list[str]]:
    """Give the migrations that this installation's tables have been through."""
    return sorted(list(name) for name in MigrationRecorder(connection).applied_migrations())


@contextmanager
def one_moment() -> Iterator[None]:
    """See the database as it is now until the block ends, without holding up anyone who writes."""
    if connection.in_atomic_block:
        yield
    elif connection.vendor == "postgresql":
        with transaction.atomic(), connection.cursor() as cursor:
            cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
            yield
    else:
        # Not atomic(): that would take SQLite's only place for a writer.
        with connection.cursor() as cursor:
            cursor.execute("BEGIN DEFERRED")
            try:
                yield
            finally:
                cursor.execute("ROLLBACK")


class _Packer:
    """Text that is written to it goes compressed into a sealed file."""

    def __init__(self, file: BinaryIO, passphrase: str) -> None:
        self._sealer, self._packer = Sealer(file, passphrase), zlib.compressobj()

    def write(self, text: str) -> None:
        """Take more text."""
        self._sealer.write(self._packer.compress(text.encode()))

    def close(self) -> None:
        """Write what is left."""
        self._sealer.write(self._packer.flush())
        self._sealer.close()


def write_backup(file: BinaryIO, passphrase: str, now: datetime) -> dict[str, int]:
    """Write everything into a file; give how many rows of each model."""
    packer, kept = _Packer(file, passphrase), backed_up()
    with one_moment():
        counts = {model._meta.label_lower: model._base_manager.count() for model in kept}
        header = {"format": FORMAT, "made_at": now.isoformat(), "tables": tables_version()}
        packer.write(json.dumps(header | {"counts": counts}) + "\n")
        for model in kept:
            rows = model._base_manager.order_by("pk").iterator(chunk_size=A_TIME)
            names = [field.name for field in model._meta.concrete_fields]
            serializers.serialize("jsonl", rows, stream=packer, fields=names)
    packer.close()
    return counts


def read_lines(file: BinaryIO, passphrase: str) -> Iterator[str]:
    """Give a backup's lines. Raises CannotUnseal."""
    unpacker, rest = zlib.decompressobj(), b""
    for chunk in unseal(file, passphrase):
        *lines, rest = (rest + unpacker.decompress(chunk)).split(b"\n")
        yield from (line.decode() for line in lines)


def restore_backup(file: BinaryIO, passphrase: str) -> dict[str, int]:
    """Take a backup into an installation that nobody has used; give how many rows of each model.

    All of it or nothing. Raises CannotUnseal and CannotRestore.
    """
    if User.everywhere.exists():
        raise CannotRestore(
            "This installation has accounts already. Restore into a new one: an empty "
            "GARRY_DATA_DIR, or an empty database."
        )
    lines = read_lines(file, passphrase)
    header = json.loads(next(lines))
    if header["format"] != FORMAT or header["tables"] != tables_version():
        raise CannotRestore(
            f"The backup was made on {header['made_at'][:10]} by another version of GARRY. Install "
            "that version, restore, and then update."
        )
    kept = backed_up()
    with transaction.atomic():
        for model in kept:  # a new installation comes with measures and protocols of its own
            model._base_manager.all()._raw_delete(connection.alias)  # noqa: SLF001
        for row in serializers.deserialize("jsonl", lines):
            row.save(save_m2m=False, force_insert=True)
        counts = {model._meta.label_lower: model._base_manager.count() for model in kept}
        if counts != header["counts"]:
            raise CannotRestore("Rows are missing. Take another copy of the backup.")
        with connection.cursor() as cursor:
            for statement in connection.ops.sequence_reset_sql(no_style(), kept):
                cursor.execute(statement)
    return counts
