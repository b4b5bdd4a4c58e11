"""A database of each release, with a session in it, becomes one of today and walks on."""

from __future__ import annotations

import gzip
import json
import sqlite3
from pathlib import Path

import pytest

from tests.support.release import RELEASES, database
from tests.support.servers import run_python

pytestmark = [pytest.mark.server, pytest.mark.long]
OF_TODAY = "today"
SESSIONS = """
    SELECT id, valence, state, goal, active_s,
        (SELECT count(*) FROM rehab_step WHERE session_id = s.id),
        (SELECT sum(points) FROM rehab_step WHERE session_id = s.id)
    FROM rehab_trainingsession AS s ORDER BY id
"""


def read(database: sqlite3.Connection) -> list[tuple[object, ...]]:
    """Return each session with its count of steps and its points."""
    return database.execute(SESSIONS).fetchall()


@pytest.mark.parametrize("release", [OF_TODAY, *sorted(f.name for f in RELEASES.glob("*.gz"))])
def test_a_release_s_database_becomes_one_of_today(release: str, tmp_path: Path) -> None:
    dumped = database() if release == OF_TODAY else (RELEASES / release).read_bytes()
    with sqlite3.connect(tmp_path / "garry.sqlite3") as made:
        made.executescript(gzip.decompress(dumped).decode())
        before = read(made)
    made.close()
    assert len(before) == 1
    run_python(tmp_path, "manage.py", "migrate", "--verbosity", "0")
    with sqlite3.connect(tmp_path / "garry.sqlite3") as now:
        assert read(now) == before
    now.close()
    walked = run_python(
        tmp_path, "manage.py", "runsession", "--synthetic", "8", "--valence", "positive",
        "--strides", "100", "--speed", "max", "--json",
    )  # fmt: skip
    assert json.loads(walked)["strides"] == 100
