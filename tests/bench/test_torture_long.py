"""A hundred kills: 0 acknowledged steps lost, 0 gaps or doubles at viewers."""

import asyncio
import os

from tests.support.torture import Torture


def test_a_hundred_kills_lose_nothing(tmp_path):
    seed = int(os.environ.get("GARRY_TEST_SEED", "20261121"))
    torture = Torture(tmp_path, seed)
    ended = asyncio.run(torture.run(sessions=20, rounds=100))
    steps = sum(walk.made for walk in torture.walks)
    faults = torture.find_faults(ended)
    print(f"\ntorture: seed {seed}, 100 kills, 20 sessions, {steps} steps, {len(faults)} faults")
    assert faults == []
