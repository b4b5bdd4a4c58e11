"""Who may order a robot, and orders on their way to the server that owns a session."""

from __future__ import annotations

import msgspec
import pytest

from rehab.people.models import User
from rehab.sessions.live.orders import ArmOrder, ChangeOrder, RemarkOrder, StopOrder
from rehab.sessions.live.robot_permissions import read_robot_order
from rehab.sessions.live.servers.order_messages import pack_order, unpack_order
from rehab.sessions.log import Remark
from rehab.stations.models import Device
from rehab.training.changes import ChangeKind
from rehab.training.controls import Audience
from robot.wire.frames import BadFrame

PERSON, DEVICE = User(pk=7), Device(pk=3)


@pytest.mark.parametrize(
    "order",
    [
        ChangeOrder(ChangeKind.GOAL, 3.5, PERSON),
        ChangeOrder("feedback_text", {"valence": "positive", "bands": []}, PERSON),
        ChangeOrder("pause", "patient", None),
        RemarkOrder(Remark.PAIN, None, PERSON),
        StopOrder(None, {"device": 3, "reason": "bump"}),
        StopOrder(PERSON),
        ArmOrder(PERSON),
    ],
    ids=str,
)
def test_an_order_arrives_at_the_owner_as_it_was_given(order):
    sent = msgspec.msgpack.decode(msgspec.msgpack.encode(pack_order(order)))
    assert unpack_order(sent) == order


@pytest.mark.parametrize("by", [{}, {"by": None}, {"by": "7"}, {"by": {"device": 3}}], ids=str)
def test_an_arming_that_no_person_ordered_is_none(by):
    with pytest.raises((msgspec.ValidationError, NotImplementedError)):
        unpack_order({"type": "arm", **by})


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
