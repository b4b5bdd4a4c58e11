"""The robot on the server's side: what it hears and reports, and what the log keeps of it."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from asgiref.sync import sync_to_async

from rehab.gestures.models import ComposedGesture
from rehab.people.models import Clinic
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.session import subscribers
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import SessionEvent
from rehab.training.valences import CueGestures
from robot.motion.dry_run import validate_gesture
from tests.support.callers import Message, restart
from tests.support.robot_reports import ARM, DECISION, GESTURE, STATUS, is_stopped, log_of


async def test_reports_are_shown_and_decisions_and_gestures_kept(place, begun):
    session = await begun(place)
    robot, source = await place.robot().open(), await place.source().dial()
    tablet, monitor = await place.tablet(session).open(), place.monitor(session)
    assert (await monitor.watch())["robot"] == {"status": None, "decision": None}
    await source.hello()
    await source.walk(4.0, 3.2)
    for report in (STATUS, DECISION, GESTURE):
        await robot.say({"type": "report", "report": report})
        event = await monitor.until(lambda event, report=report: event.get("report") == report)
        assert event["kind"] == "robot"
    await source.walk(2.0)
    assert await log_of(session) == [
        {
            "kind": f"robot_{report['kind']}",
            "by": None,
            "data": {name: value for name, value in report.items() if name != "kind"},
            "after_number": 2,
        }
        for report in (DECISION, GESTURE)
    ]
    again = place.monitor(session)
    assert (await again.watch())["robot"] == {"status": STATUS, "decision": DECISION}
    assert "robot" not in await place.tablet(session).watch()
    await tablet.overhear()
    assert "robot" not in [event["kind"] for event in tablet.events]

    live = await runtimes.current().session(session.pk)
    loaded = await sync_to_async(SessionAggregate.load)(live.aggregate.session)
    assert loaded.fold.score == live.aggregate.fold.score == 1
    assert loaded.fold.last_number == 3


def spoiled(report: Message, *path: str, value: Any) -> Message:
    """Return a report with one part replaced."""
    report = copy.deepcopy(report)
    part = report
    for name in path[:-1]:
        part = part[name]
    part[path[-1]] = value
    return report


@pytest.mark.parametrize(
    "report",
    [
        spoiled(STATUS, "base", value=3),
        spoiled(STATUS, "state", value="flying"),
        spoiled(STATUS, "state", value=["idle"]),
        spoiled(STATUS, "pose", value=[0, 0, 0]),
        spoiled(STATUS, "pose", "x_m", value=None),
        spoiled(STATUS, "pose", "heading_rad", value="0"),
        spoiled(STATUS, "gesture", value="<b>"),
        spoiled(STATUS, "reason", value=None),
        spoiled(DECISION, "above", value=1),
        spoiled(DECISION, "mean", value=None),
        spoiled(DECISION, "steps", value=0),
        spoiled(DECISION, "activated_share", value=True),
        spoiled(DECISION, "reason", value="x" * 65),
        spoiled(GESTURE, "name", value=""),
        spoiled(GESTURE, "phase", value="begun"),
        spoiled(GESTURE, "outcome", value={}),
        spoiled(STATUS, "battery_v", value="full"),
        spoiled(STATUS, "battery_share", value=True),
        spoiled(STATUS, "battery_low", value=0.2),
        spoiled(STATUS, "open_loop", value="yes"),
        spoiled(STATUS, "bumpers", value=3),
        spoiled(GESTURE, "open_loop", value=None),
        spoiled(DECISION, "intensity", value="much"),
        {"kind": "stop"},
        {"kind": "stop", "reason": ""},
        *(
            pytest.param(GESTURE | spoiler, marks=pytest.mark.postgres)
            for spoiler in ({"note": "\x00"}, {"note": ["half of two: \ud83d"]}, {"a\x00b": 1})
        ),
        "status",
    ],
    ids=str,
)
async def test_a_report_that_is_none_is_refused_and_not_kept(place, begun, report):
    session = await begun(place)
    robot = await place.robot().open()
    await robot.say({"type": "report", "report": report})
    code, error = await robot.sent_away()
    assert (code, error["code"]) == (4400, "bad_frame")
    assert await log_of(session) == []


async def test_a_robot_that_stopped_itself_stays_stopped_for_everyone(place, begun):
    session = await begun(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    for _ in range(2):
        await robot.say({"type": "report", "report": {"kind": "stop", "reason": "bump"}})
        await robot.hear("stop")
    await monitor.until(is_stopped(True))
    await monitor.until(lambda event: event["kind"] == "alarms")
    data = {"device": place.devices["robot"].pk, "reason": "bump"}
    assert await log_of(session) == [
        {"kind": "robot_stop", "by": None, "data": data, "after_number": 0}
    ]
    await robot.hang_up()
    robot = await place.robot().dial()
    assert (await robot.hello())["stopped"] is True
    await monitor.say(ARM)
    await robot.hear("arm")


async def test_a_robot_is_told_whether_a_pt_looks_on(place, begun, monkeypatch):
    session = await begun(place)
    robot = await place.robot().dial()
    await place.tablet(session).open()
    assert (await robot.hello())["watched"] is False
    assert (await robot.hear("heartbeat"))["watched"] is False
    monitor = await place.monitor(session).open()
    while not (await robot.hear("heartbeat"))["watched"]:
        pass
    again = await place.robot().dial()
    assert (await again.hello())["watched"] is True
    await monitor.hang_up()
    while (await again.hear("heartbeat"))["watched"]:
        pass


async def test_a_page_that_confirms_nothing_is_nobody_looking_on(place, begun, monkeypatch):
    monkeypatch.setattr(subscribers, "INATTENTIVE_S", 0.2)
    session = await begun(place)
    await place.monitor(session).open()
    robot = await place.robot().open()
    await robot.say({"type": "report", "report": STATUS})  # nobody confirms having seen it
    while (await robot.hear("heartbeat"))["watched"]:
        pass


async def test_reports_before_a_session_go_nowhere(place, ready):
    robot = await place.robot().dial()
    assert (await robot.hello())["session"] is None
    await robot.say({"type": "report", "report": DECISION})
    session = await ready(place)
    assert (await robot.hear("welcome"))["session"] == session.pk
    assert await log_of(session) == []


async def test_what_a_robot_missed_is_past(place, begun):
    session = await begun(place)
    source, robot = await place.source().open(), await place.robot().open()
    await source.walk(4.0)
    await robot.hear("step")
    await robot.hang_up()
    await source.walk(4.0, 4.0)
    robot = await place.robot().dial()
    assert (await robot.hello())["session"] == session.pk
    await source.walk(4.0)
    assert (await robot.hear("step"))["number"] == 4


async def test_a_pt_calms_the_robot_with_one_tap(place, begun):
    session = await begun(place)
    robot, source = await place.robot().dial(), await place.source().dial()
    assert (await robot.hello())["cue"]["intensity"] == 1
    await source.hello()
    await source.walk(4.0, 4.0)
    monitor, tablet = place.monitor(session), place.tablet(session)
    assert (await monitor.watch())["robot_intensity"] == 1
    assert "robot_intensity" not in await tablet.watch()
    for level in (0.5, 0):
        assert (await monitor.change("robot_intensity", level))["type"] == "done"
        cue = (await robot.hear("cue"))["cue"]
        assert (cue["intensity"], cue["above"], cue["threshold"]) == (level, "varied", 0.9)
        await monitor.until(
            lambda event, v=level: event["kind"] == "robot_intensity" and event["value"] == v
        )
    refused = await monitor.change("robot_intensity", 0.7)
    assert (refused["type"], refused["code"]) == ("error", "refused")
    rows = SessionEvent.everywhere.filter(session=session, kind="robot_intensity").order_by("pk")
    fields = ("old", "value", "by", "after_number")
    by = place.pt.pk
    assert [row async for row in rows.values_list(*fields)] == [(1, 0.5, by, 2), (0.5, 0, by, 2)]

    await restart()
    assert (await (await place.robot().dial()).hello())["cue"]["intensity"] == 0
    assert (await place.monitor(session).watch())["robot_intensity"] == 0


async def test_composed_gestures_travel_in_the_cue(place, ready):
    wave = await sync_to_async(compose)(place.clinic)
    await ready(place, cue=CueGestures(above="wave"))
    cue = (await (await place.robot().dial()).hello())["cue"]
    assert (cue["above"], cue["below"]) == ("wave", None)
    assert cue["gestures"] == [wave]
    assert validate_gesture(cue["gestures"][0]).name == "wave"


def compose(clinic: Clinic) -> Message:
    """Make a gesture; return it as it travels."""
    gesture = ComposedGesture.everywhere.create(clinic=clinic, name="wave")
    for position, degrees in enumerate((30, -60, 30), start=1):
        gesture.steps.create(position=position, turn_deg=degrees)
    return gesture.to_data()
