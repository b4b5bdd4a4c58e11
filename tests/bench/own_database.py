"""Benches that run in a process and on a database of their own, with rows copied in it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.support.servers import ROOT, clean_environment

POSTGRES = os.environ.get("DATABASE_URL", "postgres://postgres@127.0.0.1:5432/postgres")


def run_alone(module: str, *arguments: object, folder: Path, database: str = "") -> dict[str, Any]:
    """Run a module of this folder; return the JSON that it prints last.

    ``database``: its address; of a new SQLite file in the folder where there is none.
    """
    folder.mkdir(exist_ok=True)
    own = {
        "DJANGO_SETTINGS_MODULE": "garry_site.settings",
        "GARRY_DATABASE_URL": database or f"sqlite:///{folder / 'bench.sqlite3'}",
    }
    done = subprocess.run(
        [sys.executable, "-m", f"tests.bench.{module}", *map(str, arguments)],
        cwd=ROOT,
        env=clean_environment(folder, 8000) | own,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@contextmanager
def make_postgresql(of: str = "bench") -> Iterator[str]:
    """Make a database on the server at DATABASE_URL; give its address. Skips without a server."""
    import psycopg
    from psycopg import sql

    try:
        server = psycopg.connect(POSTGRES, autocommit=True, connect_timeout=3)
    except psycopg.OperationalError:
        pytest.skip("no PostgreSQL answers at DATABASE_URL")
    name = f"garry_{of}_{os.getpid()}"
    server.execute(sql.SQL("CREATE DATABASE {}").format(sql.Identifier(name)))
    try:
        yield f"{POSTGRES.rpartition('/')[0]}/{name}"
    finally:
        server.execute(sql.SQL("DROP DATABASE {} WITH (FORCE)").format(sql.Identifier(name)))
        server.close()


def copy_rows(model: Any, count: int, which: str, changed: dict[str, str]) -> None:
    """Copy the rows of the table ``t`` that a condition chooses, so many times, in the database.

    ``changed``: SQL for columns that differ, with ``i`` from 1. Keys are new ones unless they are
    among them.
    """
    from django.db import connection

    columns = [field.column for field in model._meta.concrete_fields]
    columns = [column for column in columns if column != "id" or "id" in changed]
    chosen = ", ".join(changed.get(column, f"t.{column}") for column in columns)
    table, numbers, source = model._meta.db_table, "", f"generate_series(1, {count}) AS n(i)"
    if connection.vendor == "sqlite":
        numbers = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {0}) "
        source = "n"
    with connection.cursor() as cursor:
        cursor.execute(
            f"INSERT INTO {table} ({', '.join(columns)}) {numbers.format(count)}"  # noqa: S608
            f"SELECT {chosen} FROM {table} AS t, {source} WHERE {which}"
        )


def set_up() -> None:
    """Begin a process of a bench: Django, and the tables."""
    import django
    from django.core.management import call_command

    django.setup()
    call_command("migrate", verbosity=0)
