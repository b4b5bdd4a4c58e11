"""Ten million steps, and no query of the live path walks through a table that grows."""

from __future__ import annotations

import json
import os

import pytest

from tests.bench.own_database import make_postgresql, run_alone

ROWS = int(os.environ.get("GARRY_TEST_LOG_ROWS", "10000000"))


@pytest.mark.timeout(0)
@pytest.mark.parametrize("name", ["sqlite", "postgresql"])
def test_no_query_walks_through_a_table(tmp_path, name):
    if name == "sqlite":
        found = run_alone("live_queries", ROWS, folder=tmp_path)
    else:
        with make_postgresql() as address:
            found = run_alone("live_queries", ROWS, folder=tmp_path, database=address)
    print(f"\n{name}, {ROWS:,} steps: {json.dumps(found, indent=1)}")
    assert found["queries"] > 20
    assert found["scans"] == []
