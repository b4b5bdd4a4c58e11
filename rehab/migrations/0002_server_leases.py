"""Leases of the servers on a hosted database (rehab/sessions/live/database/lease.py).

No model: the rows are no clinic's, are read and written by the database's clock alone, and belong
in no backup. SQLite has one server, which needs none.
"""

from typing import Any

from django.db import migrations

CREATE = """
CREATE TABLE rehab_server (
    id varchar(32) PRIMARY KEY,
    address varchar(200) NOT NULL,
    shares boolean NOT NULL,
    expires_at timestamp with time zone NOT NULL
)
"""


def create(apps: Any, schema_editor: Any) -> None:
    """Make the table, on PostgreSQL."""
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute(CREATE)


def drop(apps: Any, schema_editor: Any) -> None:
    """Drop the table."""
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute("DROP TABLE rehab_server")


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0001_tables"),
    ]

    operations = [migrations.RunPython(create, drop)]
