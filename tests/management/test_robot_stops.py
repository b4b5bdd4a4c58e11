"""Mid-gesture, with real server, worker and bytes: whatever happens, the base stands still."""

import sys

import pytest

from tests.support.extent import EVERYTHING
from tests.support.robot_room import robot_room
from tests.support.robot_stops import LINK_S, STOPS, kill_server

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(sys.platform == "win32", reason="no pty, no such signals"),
]

ROUNDS = 2 if EVERYTHING else 1


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    with robot_room(tmp_path_factory.mktemp("room")) as room:
        yield room


@pytest.mark.parametrize("name", STOPS)
def test_the_base_stands_still(room, name):
    limit_s, deed = STOPS[name]
    for _ in range(ROUNDS):
        room.perform()
        took_s = deed(room)
        assert 0 < took_s <= limit_s


def test_a_server_that_is_killed(tmp_path):
    with robot_room(tmp_path) as room:
        room.perform()
        assert 0 < kill_server(room) <= LINK_S
