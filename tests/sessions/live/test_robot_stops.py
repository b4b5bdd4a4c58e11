"""Stopping the robot from the server's side: anyone may, a person arms it, and a stop holds."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from django.db import OperationalError

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.session import commit_transaction
from rehab.sessions.live.session import group_commit as writers
from tests.support.callers import change, restart, turns
from tests.support.robot_reports import ARM, STOP, is_stopped, log_of
from tests.support.world import NOW


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
    await monitor.say(STOP)  # once more: the robot hears it again, the page is answered
    await robot.hear("stop")
    while sum(map(is_stopped(True), monitor.events)) < 2:
        await monitor.hear("events")
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


@pytest.mark.parametrize("message", [ARM, {"type": "robot"}, {"type": "robot", "order": "dance"}])
async def test_a_patients_page_only_stops(place, begun, message):
    session = await begun(place)
    await place.robot().open()
    tablet = await place.tablet(session).open()
    await tablet.say(message)
    code, error = await tablet.sent_away()
    assert (code, "stop" in error["message"]) == (4400, True)
    assert await log_of(session) == []


async def test_a_stop_holds_over_robots_servers_and_sessions(place, begun, ready):
    session = await begun(place)
    tablet = await place.tablet(session).open()
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
    assert {one["type"] for one in await robot.overhear()} <= {"heartbeat"}
    for caller in (robot, monitor):
        await caller.hang_up()
    await restart()
    assert (await place.monitor(later).watch())["robot_stopped"] is False


async def test_a_robot_at_another_station_is_another_robot(place, elsewhere, begun):
    monitor = await place.monitor(await begun(place)).open()
    await monitor.say(STOP)
    await monitor.until(is_stopped(True))
    assert (await elsewhere.monitor(await begun(elsewhere)).watch())["robot_stopped"] is False


async def test_a_page_of_an_ended_session_stops_the_robot_all_the_same(place, begun, ready):
    old = await begun(place)
    tablet = await place.tablet(old).open()
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
    robot = await place.robot().open()
    tablet, monitor = await place.tablet(session).open(), await place.monitor(session).open()
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
    await (await runtimes.current().session(session.pk)).wait_until_committed()
    assert "arm" not in [message["type"] for message in robot.heard]
    kinds = [row["kind"] for row in await log_of(session)]
    assert kinds == ["robot_stop", "robot_arm", "robot_stop"]


def break_disk(patch: pytest.MonkeyPatch, session_id: int | None = None) -> None:
    """Let nothing, or nothing of a session, be committed until ``patch`` takes it back."""
    sound = commit_transaction.commit

    def commit(jobs: Any) -> None:
        if any(session_id in (None, job.session_id) for job in jobs):
            raise OperationalError("database or disk is full")
        sound(jobs)

    patch.setattr(writers, "commit", commit)


async def test_a_stop_that_could_not_be_stored_holds_and_is_stored_later(place, begun, monkeypatch):
    session = await begun(place)
    robot, tablet = await place.robot().open(), await place.tablet(session).open()
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
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
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
    tablet = await place.tablet(first).open()
    stall.begin()
    await tablet.say(STOP)
    await turns()
    live = await runtimes.current().session(second.pk)
    assert live.robot_orders.is_stopped
    stall.end()
    await live.wait_until_committed()
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
        live.robot_orders.stop(None, NOW, {})  # as a page that has not heard yet that it is dropped
        with pytest.raises(NotStored):
            await live.wait_until_committed()
    other = await here.session(second.pk)
    assert other.robot_orders.is_stopped
    await other.wait_until_committed()
    assert [row["kind"] for row in await log_of(second)] == ["robot_stop"]
    assert (await here.session(first.pk)).robot_orders.is_stopped


ASKED = [
    {"type": "change", "kind": "goal", "value": 3.5, "id": "x"},
    {"type": "change", "kind": "pause", "id": "x"},
    {"type": "remark", "what": "rest", "id": "x"},
]


@pytest.mark.parametrize("asked", ASKED, ids=["goal", "pause", "remark"])
async def test_a_stop_waits_for_nothing_that_its_page_asked_for_before(place, begun, stall, asked):
    session = await begun(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
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

    monkeypatch.setattr(runtimes.current().supervisor, "stop", end_slowly)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    await monitor.say({"type": "change", "kind": "finish", "id": "x"})
    await robot.hear("state")
    await monitor.say(STOP)
    await robot.hear("stop")
    ended.set()
    await monitor.hear("done")
