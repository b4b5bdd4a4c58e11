"""100,000 simulated steps scored and stored: how fast, against a bare insert, in what memory."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
STEPS = 100_000
BATCH = 500

# Runs a session in a process of its own and reports its peak memory after each tenth of the steps.
SCRIPT = """
import json, os, resource, sys, tracemalloc
import django
django.setup()
from rehab.management.commands.runsession import Command
from rehab.sessions.live import headless
count = int(sys.argv[1])
if sys.argv[2] == "trace":
    tracemalloc.start()
sizes, taken = [], 0
original = headless.LiveSession.settled
async def counting(live):
    global taken
    await original(live)
    before, taken = taken, live.aggregate.fold.last_number
    if tracemalloc.is_tracing() and taken * 10 // count > before * 10 // count:
        sizes.append(tracemalloc.get_traced_memory()[0])
headless.LiveSession.settled = counting
command = Command()
options = vars(command.create_parser("manage.py", "runsession").parse_args(
    ["--synthetic", "7", "--valence", "binary", "--strides", str(count)]))
from rehab.people.sign_in.first_start import prepare_database
prepare_database()
figures = command._run(options)
print(json.dumps({"steps_per_s": figures["steps_per_s"], "strides": figures["strides"],
                  "sizes": sizes}))
"""


def run_session(folder: Path, steps: int, mode: str) -> dict[str, Any]:
    folder.mkdir()
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(steps), mode],
        cwd=ROOT,
        env={
            "DJANGO_SETTINGS_MODULE": "garry_site.settings",
            "GARRY_DATA_DIR": str(folder),
            "PATH": "/usr/bin:/bin",
        },
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(json.loads(result.stdout))


def bare_inserts_per_s(folder: Path) -> float:
    """Insert rows of the same width with nothing but sqlite3, as durable as ours."""
    connection = sqlite3.connect(folder / "floor.sqlite3", isolation_level=None)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA synchronous=FULL")
    names = [f"c{i}" for i in range(17)]
    connection.execute(f"CREATE TABLE t (id INTEGER PRIMARY KEY, {', '.join(names)})")
    connection.execute("CREATE UNIQUE INDEX u ON t (c0, c1)")
    insert = f"INSERT INTO t ({', '.join(names)}) VALUES ({', '.join('?' * 17)})"  # noqa: S608
    row = (1.1, "2026-11-21 10:00:00", "left", 3.9, 1.0, 3.9, 3.8, 1.02, 1, 1, 1, "[]", 1, 1, "{}")
    began = time.perf_counter()
    for first in range(0, STEPS, BATCH):
        connection.execute("BEGIN IMMEDIATE")
        connection.executemany(insert, [(1, first + i, *row) for i in range(BATCH)])
        connection.execute("COMMIT")
    seconds = time.perf_counter() - began
    connection.close()
    return STEPS / seconds


def test_steps_per_second_against_a_bare_insert(tmp_path):
    floors, speeds = [], []
    for repeat in range(3):
        floors.append(bare_inserts_per_s(make_folder(tmp_path, f"floor{repeat}")))
        result = run_session(tmp_path / f"run{repeat}", STEPS, "plain")
        assert result["strides"] == STEPS
        speeds.append(result["steps_per_s"])
    floor, speed = sorted(floors)[1], sorted(speeds)[1]
    print(
        f"\nheadless: {speed:,.0f} steps/s simulated, scored and stored (median of 3); "
        f"bare insert {floor:,.0f} rows/s; ratio {floor / speed:.1f}"
    )
    assert floor / speed < 40


def test_memory_stays_flat_over_a_long_session(tmp_path):
    sizes = run_session(tmp_path / "traced", STEPS, "trace")["sizes"]
    print("\nPython memory after each tenth (MB): " + ", ".join(f"{s / 1e6:.1f}" for s in sizes))
    assert sizes[-1] < sizes[0] + 1_000_000


def make_folder(tmp_path: Path, name: str) -> Path:
    folder = tmp_path / name
    folder.mkdir()
    return folder
