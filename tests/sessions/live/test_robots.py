"""The robot on the server's side: anyone stops it, a person arms it, the log keeps what it did."""

from __future__ import annotations

import asyncio
import copy
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import OperationalError

from rehab.gestures.models import Gesture
from rehab.people.models import Clinic
from rehab.sessions.live import hub
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live import writer as writers
from rehab.sessions.live.actor import SessionActor
from rehab.sessions.live.session import NotStored
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.training.valences import Cue
from robot.motion.dry_run import validate_gesture
from tests.support.callers import Message, change, turns
from tests.support.world import NOW

STATUS = {
    "kind": "status",
    "base": "kinematic",
    "state": "performing",
    "gesture": "celebrate",
    "pose": {"x_m": 0.01, "y_m": 0, "heading_rad": -0.2},
    "reason": "",
}
DECISION = {
    "kind": "decision",
    "from_s": 1.1,
    "until_s": 6.1,
    "steps": 4,
    "mean": 1.2,
    "threshold": 0.9,
    "above": True,
    "gesture": "celebrate",
    "reason": "",
    "activated_share": 0.75,
}
GESTURE = {"kind": "gesture", "name": "celebrate", "phase": "ended", "outcome": "done"}

STOP = {"type": "robot", "order": "stop"}
ARM = {"type": "robot", "order": "arm"}


async def log_of(session: TrainingSession) -> list[Message]:
    """Give what the log has of the session's robot."""
    events = SessionEvent.everywhere.filter(session=session, kind__startswith="robot_")
    fields = ("kind", "by", "data", "after_number")
    return [row async for row in events.order_by("pk").values(*fields)]


def is_stopped(stopped: bool) -> Any:
    return lambda event: event == {"kind": "robot_stopped", "stopped": stopped}


async def restart() -> None:
    """Let this server go and another one come."""
    runtime = runtimes.current()
    await runtime.drain()
    runtimes._current = None


async def test_anyone_stops_the_robot_and_only_a_person_arms_it(place, begun):
    session = await begun(place)
    robot = await place.robot().dial()
    assert (await robot.hello())["stopped"] is False
    tablet, monitor = place.tablet(session), place.monitor(session)
    assert (await tablet.watch())["robot_stopped"] is False
    assert (await monitor.watch())["robot_stopped"] is False

    await tablet.say(STOP)
    assert await robot.hear("stop") == {"type": "stop"}
    await tablet.until(is_stopped(True))
    await monitor.until(is_stopped(True))
    await monitor.say(STOP)  # once more: the robot hears it again, nothing else happens
    await robot.hear("stop")
    await turns()
    device = {"device": place.devices["tablet"].pk}
    assert await log_of(session) == [
        {"kind": "robot_stop", "by": None, "data": device, "after_number": 0}
    ]

    await monitor.say(ARM)
    await robot.hear("arm")
    await tablet.until(is_stopped(False))
    await monitor.say(STOP)
    await robot.hear("stop")
    await monitor.say(ARM)
    await robot.hear("arm")
    kinds = [(row["kind"], row["by"]) for row in (await log_of(session))[1:]]
    by = place.pt.pk
    assert kinds == [("robot_arm", by), ("robot_stop", by), ("robot_arm", by)]


@pytest.mark.parametrize("message", [ARM, {"type": "robot"}, {"type": "robot", "order": "drive"}])
async def test_a_patients_page_only_stops(place, begun, message):
    session = await begun(place)
    robot = await place.robot().dial()
    await robot.hello()
    tablet = place.tablet(session)
    await tablet.watch()
    await tablet.say(message)
    code, error = await tablet.sent_away()
    assert (code, "stop" in error["message"]) == (4400, True)
    assert await log_of(session) == []


async def test_a_stop_holds_over_robots_servers_and_sessions(place, begun, ready):
    session = await begun(place)
    tablet = place.tablet(session)
    await tablet.watch()
    await tablet.say(STOP)  # nobody there to hear it
    await tablet.until(is_stopped(True))
    robot = await place.robot().dial()
    assert (await robot.hello())["stopped"] is True
    await robot.hang_up()
    await tablet.hang_up()

    await restart()
    robot = await place.robot().dial()
    assert (await robot.hello())["stopped"] is True
    assert (await place.monitor(session).watch())["robot_stopped"] is True
    await change(session, "abort")
    later = await ready(place)
    welcome = await robot.hear("welcome")
    assert (welcome["session"], welcome["stopped"]) == (later.pk, True)

    monitor = place.monitor(later)
    assert (await monitor.watch())["robot_stopped"] is True
    await monitor.say(ARM)
    await robot.hear("arm")
    assert (await robot.overhear()) == []
    for caller in (robot, monitor):
        await caller.hang_up()
    await restart()
    assert (await place.monitor(later).watch())["robot_stopped"] is False


async def test_a_robot_at_another_station_is_another_robot(place, elsewhere, begun):
    monitor = place.monitor(await begun(place))
    await monitor.watch()
    await monitor.say(STOP)
    await monitor.until(is_stopped(True))
    assert (await elsewhere.monitor(await begun(elsewhere)).watch())["robot_stopped"] is False


async def test_a_page_of_an_ended_session_stops_the_robot_all_the_same(place, begun, ready):
    old = await begun(place)
    tablet = place.tablet(old)
    await tablet.watch()
    await change(old, "finish")
    new = await ready(place)
    robot, monitor = await place.robot().dial(), place.monitor(new)
    assert (await robot.hello())["session"] == new.pk
    await monitor.watch()
    await tablet.say(STOP)
    await robot.hear("stop")
    await monitor.until(is_stopped(True))
    await monitor.say(ARM)
    await robot.hear("arm")
    await tablet.until(is_stopped(False))


async def test_a_stop_waits_for_no_disk_and_overtakes_an_arming(place, begun, stall):
    session = await begun(place)
    robot = await place.robot().dial()
    await robot.hello()
    tablet, monitor = place.tablet(session), place.monitor(session)
    await tablet.watch()
    await monitor.watch()
    stall.begin()
    await tablet.say(STOP)
    await robot.hear("stop")  # before it is in the log
    await monitor.say(ARM)
    await turns()
    assert "arm" not in [message["type"] for message in await robot.overhear()]
    await tablet.say(STOP)
    await robot.hear("stop")
    stall.end()
    await tablet.until(is_stopped(False))
    await monitor.until(is_stopped(False))
    await (await runtimes.current().session(session.pk)).settled()
    assert "arm" not in [message["type"] for message in robot.heard]
    kinds = [row["kind"] for row in await log_of(session)]
    assert kinds == ["robot_stop", "robot_arm", "robot_stop"]


def break_disk(patch: pytest.MonkeyPatch, session_id: int | None = None) -> None:
    """Let nothing, or nothing of a session, be committed until ``patch`` takes it back."""
    sound = writers.commit

    def commit(jobs: Any) -> None:
        if any(session_id in (None, job.session_id) for job in jobs):
            raise OperationalError("database or disk is full")
        sound(jobs)

    patch.setattr(writers, "commit", commit)


async def test_a_stop_that_could_not_be_stored_holds_and_is_stored_later(place, begun, monkeypatch):
    session = await begun(place)
    robot, tablet = await place.robot().dial(), place.tablet(session)
    await robot.hello()
    await tablet.watch()
    with monkeypatch.context() as patch:
        break_disk(patch)
        await tablet.say(STOP)
        await robot.hear("stop")
        assert (await tablet.sent_away())[0] == 4012
        assert (await robot.sent_away())[0] == 4011
        again = await place.tablet(session).dial()  # too early
        assert (await again.sent_away())[0] in (4011, 4012)
    assert (await place.tablet(session).watch())["robot_stopped"] is True
    assert (await (await place.robot().dial()).hello())["stopped"] is True
    device = {"device": place.devices["tablet"].pk}
    assert await log_of(session) == [
        {"kind": "robot_stop", "by": None, "data": device, "after_number": 0}
    ]
    await restart()
    assert (await place.tablet(session).watch())["robot_stopped"] is True


async def test_a_stop_holds_where_it_and_the_arming_after_it_are_lost(place, begun, monkeypatch):
    session = await begun(place)
    robot, monitor = await place.robot().dial(), place.monitor(session)
    await robot.hello()
    await monitor.watch()
    with monkeypatch.context() as patch:
        break_disk(patch)
        await monitor.say(STOP)
        await monitor.say(ARM)
        await robot.sent_away()
    assert "arm" not in [message["type"] for message in robot.heard]
    assert (await (await place.robot().dial()).hello())["stopped"] is True
    again = place.monitor(session)
    assert (await again.watch())["robot_stopped"] is True
    await again.say(ARM)
    await again.until(is_stopped(False))
    assert [row["kind"] for row in await log_of(session)] == ["robot_stop", "robot_arm"]


async def test_a_stop_holds_in_a_session_that_is_loaded_before_it_is_stored(
    place, begun, ready, stall
):
    first, second = await begun(place), await ready(place, beside=True)
    tablet = place.tablet(first)
    await tablet.watch()
    stall.begin()
    await tablet.say(STOP)
    await turns()
    live = await runtimes.current().session(second.pk)
    assert live.robot_stopped
    stall.end()
    await live.settled()
    assert [row["kind"] for row in await log_of(second)] == ["robot_stop"]


@pytest.mark.parametrize("opened", ["before", "after"])
async def test_a_stop_lost_in_one_session_holds_in_the_other_of_its_station(
    place, begun, ready, monkeypatch, opened
):
    first, second = await begun(place), await ready(place, beside=True)
    here = runtimes.current()
    live = await here.session(first.pk)
    if opened == "before":
        await here.session(second.pk)
    with monkeypatch.context() as patch:
        break_disk(patch, first.pk)
        live.stop_robot(None, NOW, {})  # as a page that has not heard yet that it is dropped
        with pytest.raises(NotStored):
            await live.settled()
    other = await here.session(second.pk)
    assert other.robot_stopped
    await other.settled()
    assert [row["kind"] for row in await log_of(second)] == ["robot_stop"]
    assert (await here.session(first.pk)).robot_stopped


ASKED = [
    {"type": "change", "kind": "goal", "value": 3.5, "id": "x"},
    {"type": "change", "kind": "pause", "id": "x"},
    {"type": "remark", "what": "pain", "id": "x"},
]


@pytest.mark.parametrize("asked", ASKED, ids=["goal", "pause", "remark"])
async def test_a_stop_waits_for_nothing_that_its_page_asked_for_before(place, begun, stall, asked):
    session = await begun(place)
    robot, monitor = await place.robot().dial(), place.monitor(session)
    await robot.hello()
    await monitor.watch()
    stall.begin()
    await monitor.say(asked)
    await turns()
    await monitor.say(STOP)
    await robot.hear("stop")
    assert "done" not in [message["type"] for message in await monitor.overhear()]
    stall.end()
    await monitor.hear("done")
    await monitor.until(is_stopped(True))


async def test_a_stop_waits_for_no_source_that_ends_with_its_session(place, begun, monkeypatch):
    session = await begun(place)
    ended = asyncio.Event()

    async def end_slowly(name: str) -> None:
        await ended.wait()

    monkeypatch.setattr(runtimes.current().children, "stop", end_slowly)
    robot, monitor = await place.robot().dial(), place.monitor(session)
    await robot.hello()
    await monitor.watch()
    await monitor.say({"type": "change", "kind": "finish", "id": "x"})
    await robot.hear("state")
    await monitor.say(STOP)
    await robot.hear("stop")
    ended.set()
    await monitor.hear("done")


async def test_reports_are_shown_and_decisions_and_gestures_kept(place, begun):
    session = await begun(place)
    robot, source = await place.robot().dial(), await place.source().dial()
    tablet, monitor = place.tablet(session), place.monitor(session)
    await robot.hello()
    await tablet.watch()
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
    loaded = await sync_to_async(SessionActor.load)(live.actor.session)
    assert loaded.fold.score == live.actor.fold.score == 1
    assert loaded.fold.last_number == 3


def spoiled(report: Message, *path: str, value: Any) -> Message:
    """Give a report with one part replaced."""
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
        "status",
    ],
    ids=str,
)
async def test_a_report_that_is_none_is_refused_and_not_kept(place, begun, report):
    session = await begun(place)
    robot = await place.robot().dial()
    await robot.hello()
    await robot.say({"type": "report", "report": report})
    code, error = await robot.sent_away()
    assert (code, error["code"]) == (4400, "bad_frame")
    assert await log_of(session) == []


async def test_a_robot_that_stopped_itself_stays_stopped_for_everyone(place, begun):
    session = await begun(place)
    robot, monitor = await place.robot().dial(), place.monitor(session)
    await robot.hello()
    await monitor.watch()
    for _ in range(2):
        await robot.say({"type": "report", "report": {"kind": "stop", "reason": "bump"}})
        await robot.hear("stop")
    await monitor.until(is_stopped(True))
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
    robot, tablet = await place.robot().dial(), place.tablet(session)
    await tablet.watch()
    assert (await robot.hello())["watched"] is False
    assert (await robot.hear("heartbeat"))["watched"] is False
    monitor = place.monitor(session)
    await monitor.watch()
    while not (await robot.hear("heartbeat"))["watched"]:
        pass
    again = await place.robot().dial()
    assert (await again.hello())["watched"] is True
    await monitor.hang_up()
    while (await again.hear("heartbeat"))["watched"]:
        pass


async def test_a_page_that_confirms_nothing_is_nobody_looking_on(place, begun, monkeypatch):
    monkeypatch.setattr(hub, "ABSENT_S", 0.2)
    session = await begun(place)
    monitor = place.monitor(session)
    await monitor.watch()
    robot = await place.robot().dial()
    await robot.hello()
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
    source, robot = await place.source().dial(), await place.robot().dial()
    await source.hello()
    await robot.hello()
    await source.walk(4.0)
    await robot.hear("step")
    await robot.hang_up()
    await source.walk(4.0, 4.0)
    robot = await place.robot().dial()
    assert (await robot.hello())["session"] == session.pk
    await source.walk(4.0)
    assert (await robot.hear("step"))["number"] == 4


async def test_a_robot_hears_what_the_original_s_topics_tell(place, begun):
    session = await begun(place)
    source, robot = await place.source().dial(), await place.robot().dial()
    await source.hello()
    assert (await robot.hello())["valence"] == session.plan["valence"]["slug"]
    await source.walk(4.0)
    step = await robot.hear("step")
    assert step["shown"] / step["goal"] == pytest.approx(step["performance"])


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
        assert (cue["intensity"], cue["above"], cue["threshold"]) == (level, "celebrate", 0.9)
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


async def test_a_tablet_leaves_the_robot_s_intensity_alone(place, begun):
    session = await begun(place)
    tablet = place.tablet(session)
    await tablet.watch()
    await tablet.say({"type": "change", "kind": "robot_intensity", "value": 0, "id": "x"})
    assert "therapist" in (await tablet.hear("error"))["message"]


async def test_composed_gestures_travel_in_the_cue(place, ready):
    wave = await sync_to_async(compose)(place.clinic)
    await ready(place, cue=Cue(above="wave"))
    cue = (await (await place.robot().dial()).hello())["cue"]
    assert (cue["above"], cue["below"]) == ("wave", None)
    assert cue["gestures"] == [wave]
    assert validate_gesture(cue["gestures"][0]).name == "wave"


def compose(clinic: Clinic) -> Message:
    """Make a gesture; give it as it travels."""
    gesture = Gesture.everywhere.create(clinic=clinic, name="wave")
    for position, degrees in enumerate((30, -60, 30), start=1):
        gesture.steps.create(position=position, turn_deg=degrees)
    return gesture.to_data()
