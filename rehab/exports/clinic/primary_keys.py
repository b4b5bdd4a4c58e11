"""Keys that databases have issued, and ranges of them that are reserved for an import."""

from __future__ import annotations

from typing import Any

from rehab.exports.clinic.clinic_models import Table, moving_tables

MARGIN = 10_000  # keys that others may take between reading and reserving


def last_keys(connection: Any) -> dict[str, int]:
    """Return the last key that each table has issued."""
    return {table.label: _last_key(connection, table) for table in moving_tables()}


def _last_key(connection: Any, table: Table) -> int:
    meta = table.model._meta
    with connection.cursor() as cursor:
        cursor.execute(f"SELECT MAX(id) FROM {meta.db_table}")  # noqa: S608
        stored = cursor.fetchone()[0] or 0
        if connection.vendor == "postgresql":
            cursor.execute("SELECT pg_get_serial_sequence(%s, 'id')", [meta.db_table])
            (sequence,) = cursor.fetchone()
            cursor.execute(f"SELECT last_value FROM {sequence}")  # noqa: S608
        else:
            cursor.execute("SELECT seq FROM sqlite_sequence WHERE name = %s", [meta.db_table])
        row = cursor.fetchone()
    return max(stored, row[0] if row else 0)


def reserve_keys(connection: Any, wanted: dict[str, int]) -> dict[str, int]:
    """Reserve so many keys of each table; return what comes before them.

    Rows that others add meanwhile get keys beyond. On SQLite inside of a transaction.
    """
    shifts: dict[str, int] = {}
    for table in moving_tables():
        name, count = table.model._meta.db_table, wanted[table.label]
        before = _last_key(connection, table)
        with connection.cursor() as cursor:
            if connection.vendor == "postgresql":
                before += MARGIN
                cursor.execute(
                    "SELECT setval(pg_get_serial_sequence(%s, 'id'), %s)", [name, before + count]
                )
            else:
                cursor.execute("DELETE FROM sqlite_sequence WHERE name = %s", [name])
                cursor.execute(
                    "INSERT INTO sqlite_sequence (name, seq) VALUES (%s, %s)",
                    [name, before + count],
                )
        shifts[table.label] = before
    return shifts
