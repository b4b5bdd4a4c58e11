"""kill -9 at any moment loses nothing acknowledged, and no viewer notices more than a pause."""

import asyncio
import os
import time

import pytest

from tests.support.torture import Torture

pytestmark = pytest.mark.server


@pytest.mark.parametrize("kills", [1, pytest.param(3, marks=pytest.mark.long)])
def test_kills_lose_nothing(tmp_path, capsys, kills):
    seed = int(os.environ.get("GARRY_TEST_SEED", time.time_ns() % 1_000_000))
    with capsys.disabled():
        print(f"\ntorture: GARRY_TEST_SEED={seed}")
    torture = Torture(tmp_path, seed)
    ended = asyncio.run(torture.run(sessions=8, rounds=kills))
    assert torture.find_faults(ended) == []
    assert sum(walk.acknowledged for walk in torture.walks) > 30 * kills
    assert all(log["paused"] == log["resumed"] == kills for log in ended["log"].values())
    assert all(log["valid"] for log in ended["log"].values())


@pytest.mark.long
@pytest.mark.timeout(600)
def test_orderly_restarts_pause_nobody(tmp_path):
    torture = Torture(tmp_path, seed=7)
    ended = asyncio.run(torture.run(sessions=8, rounds=20, orderly=1.0))
    assert torture.find_faults(ended) == []
    assert all(log["paused"] == 0 for log in ended["log"].values())
    assert sum(walk.acknowledged for walk in torture.walks) > 25 * 20
