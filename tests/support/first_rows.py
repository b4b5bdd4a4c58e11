"""The rows that a migrated database begins with, brought back after a test that commits its own."""

from __future__ import annotations

from typing import Any

from django.core.management import call_command
from django.db import connection, transaction


class FirstRows:
    """Content types, permissions and what `post_migrate` makes for clinics.

    Django's TransactionTestCase empties all tables and makes these rows anew, at ten times the
    cost.
    """

    def __init__(self) -> None:
        self._rows: dict[str, list[tuple[Any, ...]]] = {}
        with connection.cursor() as cursor:
            for table in connection.introspection.django_table_names(only_existing=True):
                cursor.execute(f"SELECT * FROM {connection.ops.quote_name(table)}")  # noqa: S608
                if rows := cursor.fetchall():
                    self._rows[table] = rows

    def restore(self) -> None:
        """Leave nothing but them."""
        options = {"interactive": False, "reset_sequences": False, "inhibit_post_migrate": True}
        call_command("flush", verbosity=0, **options)
        with transaction.atomic(), connection.cursor() as cursor:
            for table, rows in self._rows.items():
                places = ", ".join(["%s"] * len(rows[0]))
                name = connection.ops.quote_name(table)
                cursor.executemany(f"INSERT INTO {name} VALUES ({places})", rows)  # noqa: S608
