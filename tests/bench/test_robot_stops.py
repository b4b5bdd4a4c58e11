"""Twenty times each, mid-gesture: how long until the base's setpoint is zero, and its wheels stand.

With a dead time of 0.2 s and a lag of 0.06 s of the base's own, as in test_process_faults.
"""

import random
import statistics

import pytest

from tests.support.robot_room import Late, robot_room
from tests.support.robot_stops import LINK_S, STOPS, kill_server

ROUNDS = 20
LATE = Late(dead_s=0.2, lag_s=0.06)


def tell(name, limit_s, took_s, still_s):
    took_ms = sorted(1000 * one for one in took_s)
    print(
        f"{name:24} limit {1000 * limit_s:4.0f} ms   median {statistics.median(took_ms):5.0f}   "
        f"largest {took_ms[-1]:5.0f}   n {len(took_ms)}   wheels still: largest "
        f"{1000 * max(still_s):5.0f}, of these dead time and lag "
        f"{1000 * (max(still_s) - max(took_s)):4.0f}"
    )
    assert took_ms[0] > 0
    assert took_ms[-1] <= 1000 * limit_s
    assert max(still_s) <= limit_s + LATE.dead_s + 6 * LATE.lag_s + 0.05


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    with robot_room(tmp_path_factory.mktemp("room"), LATE) as room:
        yield room


@pytest.mark.parametrize("name", STOPS)
def test_the_base_stands_still(room, name):
    limit_s, deed = STOPS[name]
    took_s, still_s = [], []
    for _ in range(ROUNDS):
        room.perform(random.uniform(0, 0.5))
        took_s.append(deed(room))
        still_s.append(room.rolled_s)
    tell(name, limit_s, took_s, still_s)


def test_a_server_that_is_killed(tmp_path):
    took_s, still_s = [], []
    for number in range(ROUNDS):
        with robot_room(tmp_path / str(number), LATE) as room:
            room.perform(random.uniform(0, 0.5))
            took_s.append(kill_server(room))
            still_s.append(room.rolled_s)
    tell("SIGKILL of the server", LINK_S, took_s, still_s)
