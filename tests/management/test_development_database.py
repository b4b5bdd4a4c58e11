"""A database of a development version is refused with the cure, and left as it was."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from rehab.exports.encryption import generate_key
from tests.support.servers import ROOT, clean_environment, free_port

pytestmark = pytest.mark.server


@pytest.fixture(params=["0001_initial", "0001_version_0_1"])
def folder(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A data folder with the traces by which such a database is known, and a row to lose."""
    database = sqlite3.connect(tmp_path / "garry.sqlite3")
    database.executescript(
        """
        CREATE TABLE django_migrations (
            id integer PRIMARY KEY, app varchar(255), name varchar(255), applied datetime);
        INSERT INTO django_migrations (app, name, applied)
            VALUES ('auth', '0001_initial', '2026-11-20 10:00:00'),
                   ('admin', '0001_initial', '2026-11-20 10:00:00'),
                   ('rehab', '0005_settle_tie_breakers', '2026-11-21 10:00:00');
        CREATE TABLE rehab_step (id integer PRIMARY KEY, number integer);
        INSERT INTO rehab_step (number) VALUES (1), (2);
        """
    )
    first = ("rehab", request.param, "2026-11-20 10:00:00")
    with database:
        database.execute(
            "INSERT INTO django_migrations (app, name, applied) VALUES (?, ?, ?)", first
        )
    database.close()
    return tmp_path


@pytest.mark.parametrize("command", ["serve", "migrate", "restore"])
def test_a_development_database_is_refused(folder: Path, command: str) -> None:
    (folder / "key.txt").write_text(generate_key()[0])
    words = {"restore": [str(folder / "backup"), "--key", str(folder / "key.txt")]}
    before = rows(folder)
    done = subprocess.run(
        [sys.executable, "manage.py", command, *words.get(command, [])],
        cwd=ROOT,
        env=clean_environment(folder, free_port()),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode != 0
    assert "made by a development version" in done.stderr
    assert "GARRY_DATA_DIR" in done.stderr
    assert "Traceback" not in done.stderr
    assert rows(folder) == before


def rows(folder: Path) -> list[object]:
    """Return the names of all tables, and the rows of the log."""
    database = sqlite3.connect(folder / "garry.sqlite3")
    try:
        names = database.execute("SELECT name FROM sqlite_master ORDER BY name").fetchall()
        return [*names, *database.execute("SELECT * FROM rehab_step ORDER BY id")]
    finally:
        database.close()
