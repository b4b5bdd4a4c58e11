"""What stays red on every screen until a therapist acknowledges it: a fall, a robot's own stop."""

from __future__ import annotations

from typing import Any

from asgiref.sync import ThreadSensitiveContext, sync_to_async

from rehab.sessions.alarms import Alarm
from rehab.sessions.log import SessionEvent
from rehab.sessions.services import acknowledge
from tests.support.callers import Page, change

FELL = {"type": "remark", "what": "fall", "id": "f"}
BUMPED = {"type": "report", "report": {"kind": "stop", "reason": "bump"}}


def open_kinds(message: dict[str, Any]) -> list[str]:
    return [alarm["kind"] for alarm in message["alarms"]]


async def until_open(page: Page, *kinds: str) -> dict[str, Any]:
    """Wait until a page of a therapist has been told these alarms; return the event."""
    return await page.until(
        lambda event: event["kind"] == "alarms" and open_kinds(event) == [*kinds]
    )


async def until_fell(page: Page, fell: bool) -> None:
    await page.until(lambda event: event["kind"] == "alarms" and event["fell"] is fell)


async def test_a_fall_is_told_everywhere_until_somebody_acknowledges_it(place, sourced):
    session, _ = await sourced(place)
    monitor = await place.monitor(session).open()
    other = await place.monitor(session).open()
    tablet = await place.tablet(session).open()
    assert (open_kinds(other.heard[0]), tablet.heard[0]["fell"]) == ([], False)
    await monitor.say(FELL)
    for page in (monitor, other):
        await until_open(page, "fall")
    await until_fell(tablet, True)
    late = await place.monitor(session).open()  # a page that comes later sees it, too
    assert open_kinds(late.heard[0]) == ["fall"]

    await other.say({"type": "remark", "what": "fall_acknowledged", "id": "a"})
    await until_open(monitor)
    await until_fell(tablet, False)
    assert tablet.last("alarms")["fall_seen"]
    row = await SessionEvent.everywhere.select_related("by").aget(kind="fall_acknowledged")
    assert (row.session_id, row.by) == (session.pk, place.pt)


async def test_nothing_moves_before_a_fall_is_acknowledged(place, sourced):
    session, _ = await sourced(place)
    robot = await place.robot().open()
    monitor = await place.monitor(session).open()
    await monitor.say(FELL)
    await until_open(monitor, "fall")
    await monitor.say({"type": "robot", "order": "stop"})
    await monitor.until(lambda event: event.get("stopped") is True)
    assert (await monitor.change("pause"))["type"] == "done"
    assert "take care of the fall" in (await monitor.change("resume"))["message"]
    arm = {"type": "robot", "order": "arm"}
    await monitor.say(arm)
    assert "take care of the fall" in (await monitor.hear("error"))["message"]
    assert not [frame for frame in robot.heard if frame["type"] == "arm"]

    await monitor.say({"type": "remark", "what": "fall_acknowledged", "id": "a"})
    await until_open(monitor)
    await monitor.say(arm)
    await robot.hear("arm")
    assert (await monitor.change("resume"))["type"] == "done"


async def test_no_other_session_of_who_fell_starts_before_that(place, sourced, ready):
    fallen, _ = await sourced(place)
    monitor = await place.monitor(fallen).open()
    await monitor.say(FELL)
    await until_open(monitor, "fall")
    await change(fallen, "finish")
    waiting = await place.monitor(await ready(place)).open()
    refused = await waiting.change("start")
    assert "take care of the fall: its button" in refused["message"]
    async with ThreadSensitiveContext():
        await sync_to_async(acknowledge)(fallen, Alarm.FALL, place.pt)
    assert (await waiting.change("start"))["type"] == "done"


async def test_a_session_does_not_start_with_its_own_fall(place, ready):
    monitor = await place.monitor(await ready(place)).open()
    await monitor.say(FELL)
    await until_open(monitor, "fall")
    assert "take care of the fall" in (await monitor.change("start"))["message"]


async def test_a_withdrawn_fall_takes_back_no_earlier_one(place, sourced):
    session, _ = await sourced(place)
    monitor = await place.monitor(session).open()
    for number, what in enumerate(["fall", "fall", "fall_withdrawn"]):
        await monitor.say({"type": "remark", "what": what, "id": str(number)})
        await monitor.hear("done")
    assert open_kinds(monitor.last("alarms")) == ["fall"]
    await monitor.say({"type": "remark", "what": "fall_withdrawn", "id": "3"})
    await until_open(monitor)


async def test_a_robot_that_stopped_by_itself_is_one_and_a_persons_stop_is_none(place, sourced):
    session, _ = await sourced(place)
    robot = await place.robot().open()
    monitor = await place.monitor(session).open()
    tablet = await place.tablet(session).open()
    await monitor.say({"type": "robot", "order": "stop"})
    await monitor.until(lambda event: event.get("stopped") is True)
    await monitor.say({"type": "robot", "order": "arm"})
    await monitor.until(lambda event: event.get("stopped") is False)
    assert not any(event.get("alarms") for event in monitor.events)
    await robot.say(BUMPED)
    told = await until_open(monitor, "robot_stop")
    assert told["alarms"][0]["reason"] == "bump"
    await monitor.say({"type": "remark", "what": "stop_acknowledged", "id": "a"})
    await until_open(monitor)
    fresh = await place.monitor(session).open()
    assert (open_kinds(fresh.heard[0]), fresh.heard[0]["robot_stopped"]) == ([], True)
    assert not [event for event in tablet.events if event.get("fell")]  # its page stays calm


async def test_a_robot_that_is_off_alarms_only_of_what_it_feels(place, sourced):
    session, _ = await sourced(place, robot_intensity=0.0)
    robot = await place.robot().open()
    monitor = await place.monitor(session).open()
    await robot.say({"type": "report", "report": {"kind": "stop", "reason": "base_silent"}})
    await monitor.until(lambda event: event.get("stopped") is True)  # it stays stopped
    assert not any(event.get("alarms") for event in monitor.events)
    [row] = [row async for row in SessionEvent.everywhere.filter(kind="robot_stop")]
    assert row.data["unasked"] == "base_silent"
    await monitor.say({"type": "robot", "order": "arm"})
    await monitor.until(lambda event: event.get("stopped") is False)
    await robot.say(BUMPED)
    await until_open(monitor, "robot_stop")


async def test_letting_the_robot_move_acknowledges_its_stop(place, sourced):
    session, _ = await sourced(place)
    robot = await place.robot().open()
    monitor = await place.monitor(session).open()
    await robot.say(BUMPED)
    await until_open(monitor, "robot_stop")
    await monitor.say({"type": "robot", "order": "arm"})
    await until_open(monitor)


async def test_an_alarm_outlives_its_session_and_is_acknowledged_from_a_plain_page(place, sourced):
    session, _ = await sourced(place)
    monitor = await place.monitor(session).open()
    await monitor.say(FELL)
    await until_open(monitor, "fall")
    await change(session, "finish")
    async with ThreadSensitiveContext():
        await sync_to_async(acknowledge)(session, Alarm.FALL, place.pt)
    kinds = SessionEvent.everywhere.filter(session=session).order_by("pk")
    assert [kind async for kind in kinds.values_list("kind", flat=True)] == [
        "start",
        "fall",
        "finish",
        "fall_acknowledged",
    ]
