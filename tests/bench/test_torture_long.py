"""Random ends of the server: 0 acknowledged steps lost, 0 gaps or doubles at viewers."""

import asyncio
import os

import pytest

from tests.support.torture import Torture


@pytest.mark.timeout(0)
def test_random_kills_lose_nothing(tmp_path):
    """So many ends (GARRY_TEST_KILLS), half of them orderly, on GARRY_TEST_DATABASE_URL if set."""
    seed = int(os.environ.get("GARRY_TEST_SEED", "20261121"))
    rounds = int(os.environ.get("GARRY_TEST_KILLS", "100"))
    torture = Torture(tmp_path, seed, database=os.environ.get("GARRY_TEST_DATABASE_URL", ""))
    ended = asyncio.run(torture.run(sessions=20, rounds=rounds, orderly=0.5))
    steps = sum(walk.made for walk in torture.walks)
    faults = torture.find_faults(ended)
    print(
        f"\ntorture: seed {seed}, {ended['kills']} kills, {rounds - ended['kills']} orderly ends, "
        f"20 sessions, {steps} steps, {len(faults)} faults"
    )
    assert faults == []
