"""What a robot recorded around a stop, on the server's side of the socket."""

from __future__ import annotations

import threading
from datetime import timedelta

import pytest
from asgiref.sync import sync_to_async
from django.db import OperationalError
from django.utils import timezone

from rehab.sessions import robot_incidents
from rehab.sessions.robot_incidents import RobotIncident
from robot.wire.incident import MAX_TEXT_CHARS, pack
from tests.support.world import RECORDED


def incident(of, **more):
    message = {"type": "incident", "session": of.pk, "reason": "bump", "ago_s": 6.5}
    return message | {"recording": pack(RECORDED)} | more


@sync_to_async
def stored():
    return list(RobotIncident.everywhere.order_by("pk"))


async def test_it_is_stored_with_its_session_and_told_to_the_monitor(place, begun):
    session = await begun(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    await robot.say(incident(session))
    event = await monitor.until(lambda event: event.get("report", {}).get("kind") == "incident")
    (row,) = await stored()
    assert event["report"]["incident"] == row.pk
    assert (row.session_id, row.reason) == (session.pk, "bump")
    assert timedelta(seconds=6.5) <= timezone.now() - row.at < timedelta(seconds=60)
    assert row.records() == RECORDED


async def test_one_of_another_session_is_dropped(place, begun):
    session = await begun(place)
    robot = await place.robot().open()
    await robot.say(incident(session, session=session.pk + 1))
    await robot.say({"type": "report", "report": {"kind": "stop", "reason": "bump"}})
    await robot.hear("stop")
    assert await stored() == []


@pytest.mark.parametrize(
    "wrong",
    [
        *({"recording": ""}, {"recording": None}, {"recording": "x" * (MAX_TEXT_CHARS + 1)}),
        *({"recording": "\ud800"}, {"recording": "a\x00b"}, {"recording": "no base64!"}),
        *({"reason": "<b>"}, {"reason": None}, {"session": "1"}),
        *({"ago_s": -1}, {"ago_s": None}, {"ago_s": 1e9}),
    ],
)
async def test_a_bad_one_is_refused_and_not_kept(place, begun, wrong):
    session = await begun(place)
    robot = await place.robot().open()
    await robot.say(incident(session, **wrong))
    code, error = await robot.sent_away()
    assert (code, error["code"]) == (4400, "bad_frame")
    assert await stored() == []


async def test_a_session_keeps_so_many_and_no_more(place, begun, monkeypatch):
    monkeypatch.setattr(robot_incidents, "MAX_INCIDENTS", 2)
    session = await begun(place)
    store = sync_to_async(robot_incidents.store_incident)
    kept = [await store(session.pk, timezone.now(), "bump", pack(RECORDED)) for _ in range(3)]
    assert [row.pk for row in await stored()] == kept[:2]
    assert kept[2] is None


async def test_parts_of_the_motion_are_counted_apart(place, begun, monkeypatch):
    monkeypatch.setattr(robot_incidents, "MAX_INCIDENTS", 1)
    monkeypatch.setattr(robot_incidents, "MAX_PARTS", 2)
    session = await begun(place)
    store = sync_to_async(robot_incidents.store_incident)
    reasons = ("motion", "bump", "motion", "bump", "motion")
    kept = [await store(session.pk, timezone.now(), one, pack(RECORDED)) for one in reasons]
    assert [key is not None for key in kept] == [True, True, True, False, False]


async def test_a_part_of_the_motion_is_announced_to_nobody(place, begun):
    session = await begun(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    await robot.say(incident(session, reason="motion"))
    await monitor.overhear()
    (row,) = await stored()
    assert row.reason == "motion"
    assert not [one for one in monitor.events if one.get("report", {}).get("kind") == "incident"]


async def test_a_disk_that_takes_none_changes_nothing_else(place, begun, monkeypatch):
    tried = threading.Event()

    def fail(*_):
        tried.set()
        raise OperationalError("database or disk is full")

    monkeypatch.setattr("rehab.sessions.live.consumers.robot.store_incident", fail)
    session = await begun(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    await robot.say(incident(session))
    await robot.say({"type": "report", "report": {"kind": "stop", "reason": "bump"}})
    await monitor.until(lambda event: event["kind"] == "robot_stopped")
    assert await sync_to_async(tried.wait)(10)
    await monitor.overhear()
    assert robot.code is None
