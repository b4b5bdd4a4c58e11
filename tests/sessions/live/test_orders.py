"""Who may order a robot, and orders on their way to the server that owns a session."""

from __future__ import annotations

import pytest

from rehab.people.models import User
from rehab.sessions.live.robot_permissions import read_robot_order
from rehab.stations.models import Device
from rehab.training.controls import Audience
from robot.wire.frames import BadFrame

PERSON, DEVICE = User(pk=7), Device(pk=3)


@pytest.mark.parametrize("order", ["stop", "arm", "drive", "dance", None, ["stop"]], ids=str)
@pytest.mark.parametrize("actor", [PERSON, DEVICE, None], ids=["person", "device", "nobody"])
@pytest.mark.parametrize("page", list(Audience))
def test_all_may_stop_a_robot_and_only_a_person_on_the_pts_page_moves_it(page, actor, order):
    moves = page is Audience.MONITOR and actor is PERSON
    if order == "stop" or (moves and order in ("arm", "drive")):
        assert read_robot_order({"order": order}, page, actor) == order
    else:
        with pytest.raises(BadFrame, match="stop"):
            read_robot_order({"order": order}, page, actor)
