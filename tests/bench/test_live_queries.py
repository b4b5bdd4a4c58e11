"""Ten million steps, and no query of the live path walks through a table that grows."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.servers import ROOT, clean_environment

ROWS = int(os.environ.get("GARRY_TEST_LOG_ROWS", "10000000"))
POSTGRES = os.environ.get("DATABASE_URL", "postgres://postgres@127.0.0.1:5432/postgres")


def look(name: str, address: str, folder: Path) -> None:
    ours = {"DJANGO_SETTINGS_MODULE": "garry_site.settings", "GARRY_DATABASE_URL": address}
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench.live_queries", str(ROWS)],
        cwd=ROOT,
        env=clean_environment(folder, 8000) | ours,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    print(f"\n{name}, {ROWS:,} steps: {json.dumps(found, indent=1)}")
    assert found["queries"] > 20
    assert found["scans"] == []


@pytest.mark.timeout(0)
def test_on_sqlite(tmp_path):
    look("SQLite", f"sqlite:///{tmp_path / 'log.sqlite3'}", tmp_path)


@pytest.mark.timeout(0)
def test_on_postgresql(tmp_path):
    import psycopg
    from psycopg import sql

    try:
        server = psycopg.connect(POSTGRES, autocommit=True, connect_timeout=3)
    except psycopg.OperationalError:
        pytest.skip("no PostgreSQL answers at DATABASE_URL")
    name = f"garry_log_{os.getpid()}"
    with server:
        server.execute(sql.SQL("CREATE DATABASE {}").format(sql.Identifier(name)))
    server = psycopg.connect(POSTGRES, autocommit=True)
    try:
        look("PostgreSQL", f"{POSTGRES.rpartition('/')[0]}/{name}", tmp_path)
    finally:
        server.execute(sql.SQL("DROP DATABASE {} WITH (FORCE)").format(sql.Identifier(name)))
        server.close()
