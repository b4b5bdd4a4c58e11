"""What each page and robot hears of a session, and heartbeats whatever else fails."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from rehab.sessions.live import periodic_tasks
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.prometheus_metrics import REGISTRY
from rehab.training.phases import make_phase
from tests.support.callers import (
    change,
    turns,
)


async def test_a_patient_hears_no_values_where_there_is_no_feedback(place, begun):
    session = await begun(place, make_phase("catch", strides=3), make_phase("training"))
    tablet, monitor, robot = (
        await place.tablet(session).open(),
        await place.monitor(session).open(),
        await place.robot().open(),
    )
    source = await place.source().open()
    await source.walk(4.017, 2.0)
    await source.walk(4.0, side="right")
    await source.walk(None)
    await monitor.until_step(4)
    await tablet.until(lambda event: event["kind"] == "phase")
    heard = [e for e in tablet.events if e["kind"] not in ("presence", "phase")]
    assert [(e["kind"], e["number"]) for e in heard] == [("calm", 1), ("calm", 2), ("calm", 4)]
    assert [e["phase_strides"] for e in heard] == [1, 2, 0]
    assert set(heard[0]) == {"kind", "number", "at", "active_s", "phase_s", "phase_strides"}
    await source.walk(4.0, side="right")
    await source.walk(25.0)
    await source.walk(3.3)
    step = await tablet.until_step(7)
    assert (step["kind"], step["performance"], step["shown"]) == ("step", 1.1, None)
    assert [e["kind"] for e in tablet.events if e.get("number") == 6] == ["missing"]
    await monitor.until_step(7)
    assert monitor.steps == [1, 2, 3, 4, 5, 6, 7]
    assert (await monitor.until_step(1))["value"] == 4.017
    assert (await monitor.until_step(3))["side"] == "right"
    assert (await monitor.until_step(6))["reasons"] == ["out_of_bounds"]
    heard = await robot.hear("step")
    assert (heard["number"], heard["performance"]) == (7, pytest.approx(1.1))
    assert (heard["shown"], heard["goal"]) == (3.3, 3.0)
    everything = str(tablet.heard)
    for secret in ("4.017", "'goal'", "code-elm", "25.0", "value"):
        assert secret not in everything
    assert "nick-elm" in everything


FEEDBACK: dict[str, list[tuple[Any, ...]]] = {
    "positive": [(1, 1, "gain", 1), (0, 1, "neutral", 0)],
    "negative": [(0, 0, "neutral", None), (-1, -1, "loss", None)],
    "binary": [(1, 1, "gain", 1), (-1, 0, "loss", 0)],
    "explicit": [(None, None, "neutral", None), (None, None, "neutral", None)],
}


@pytest.mark.parametrize("valence", FEEDBACK)
async def test_a_step_carries_the_feedback_of_its_valence(place, begun, valence):
    session = await begun(place, valence=valence)
    tablet = await place.tablet(session).open()
    source = await place.source().open()
    await source.walk(3.6, 2.0)
    await tablet.until_step(2)
    for number, (points, score, emblem, streak) in enumerate(FEEDBACK[valence], start=1):
        step = await tablet.until_step(number)
        assert (step["points"], step["score"]) == (points, score)
        assert (step["emblem"], step["streak"]) == (emblem, streak)
        assert step["shown"] == ((3.6, 2.0)[number - 1] if valence == "explicit" else None)
        praises = step["confetti"] != "none"
        assert praises == (number == 1 and valence in ("positive", "binary"))
        assert step["live"] is True


async def test_how_long_a_step_took_is_counted(place, begun):
    def count() -> float:
        return REGISTRY.get_sample_value("garry_delivery_seconds_count") or 0.0

    session = await begun(place)
    tablet = await place.tablet(session).open()
    source = await place.source().open()
    before = count()
    await source.walk(3.6, 2.0)
    await tablet.until_step(2)
    assert count() == before + 2


async def test_a_robot_hears_its_cue_states_and_steps(place, begun, ready, monkeypatch):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.005)
    session = await begun(place)
    robot = await place.robot().dial()
    welcome = await robot.hello()
    assert welcome["cue"]["above"] == "varied"
    assert welcome["cue"]["threshold"] == 0.9
    monitor = await place.monitor(session).open()
    await robot.hear("heartbeat")
    await change(session, "activation_threshold", 0.8)
    assert (await robot.hear("cue"))["cue"]["threshold"] == 0.8
    await change(session, "pause")
    assert (await robot.hear("state"))["state"] == "paused"
    await robot.say({"type": "report", "report": {"gesture": "celebrate"}})
    assert (await monitor.until(lambda e: e["kind"] == "robot"))["report"]["gesture"] == "celebrate"
    await change(session, "abort")
    assert (await robot.hear("state"))["state"] == "aborted"
    old = await runtimes.current().session(session.pk)
    later = await ready(place)
    assert (await robot.hear("welcome"))["session"] == later.pk
    await turns()
    assert len(old.feed.subscribers) == 1  # the monitor's: the robot listens to the new one alone


async def test_a_robot_waits_for_a_session_at_its_station(place, ready):
    robot = await place.robot().dial()
    assert await robot.hello() == {"type": "welcome", "session": None}
    await robot.say({"type": "report", "report": {"pose": [0, 0, 0]}})
    session = await ready(place)
    assert (await robot.hear("welcome"))["session"] == session.pk


async def test_robots_hear_heartbeats_in_parts_one_after_the_other(live_path, monkeypatch):
    """A thousand at once would hold up each step meanwhile."""
    runtime = runtimes.current()
    await runtime.routines.stop()
    heard: list[tuple[int, str]] = []

    def make_robot(number: int) -> SimpleNamespace:
        outbox = SimpleNamespace(queue_text=lambda text: heard.append((number, text)))
        return SimpleNamespace(outbox=outbox)

    robots = range(21, 21 + 7 * periodic_tasks.PARTS)
    for number in range(1, robots.stop):
        robot = make_robot(number) if number in robots else None
        live = SimpleNamespace(id=number, robot=robot, is_watched=False)
        monkeypatch.setitem(runtime.sessions, number, live)
    counts = []
    for _ in range(periodic_tasks.PARTS):
        before = len(heard)
        await runtime.routines._send_robot_heartbeats()
        counts.append(len(heard) - before)
    assert counts == [7] * periodic_tasks.PARTS
    text = '{"type":"heartbeat","watched":false}'
    assert sorted(heard) == [(number, text) for number in robots]


async def test_no_heartbeat_waits_for_the_disk(place, begun, ready, monkeypatch):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.002)
    disk, database = threading.Event(), asyncio.Event()
    waiting: set[str] = set()

    def move_log() -> None:
        waiting.add("checkpoint")
        assert disk.wait(10)

    def release(*_: Any) -> None:
        waiting.add("release")
        assert disk.wait(10)

    async def extend_sign_ins(*_: Any) -> None:
        waiting.add("sign-ins")
        await database.wait()

    session = await begun(place)
    robot, tablet = await place.robot().open(), await place.tablet(session).open()
    monkeypatch.setattr(periodic_tasks, "move_database_log", move_log)
    monkeypatch.setattr(periodic_tasks, "extend_sign_ins", extend_sign_ins)
    monkeypatch.setattr(clinic_owners, "note_ends", release)
    await runtimes.current().session((await ready(place, at_station=False)).pk)  # soon idle
    while len(waiting) < 3:
        await robot.hear("heartbeat")
    await robot.overhear()
    for _ in range(50):
        await robot.hear("heartbeat")
    await tablet.overhear()
    for _ in range(3):
        await tablet.hear("heartbeat")
    assert not disk.is_set()
    disk.set()
    database.set()


async def test_heartbeats_and_housekeeping_go_on_whatever_fails(place, begun, monkeypatch, caplog):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.002)
    failed: Counter[str] = Counter()

    def fail(what: str) -> Callable[..., None]:
        def failing(*_: Any) -> None:
            failed[what] += 1
            raise RuntimeError(what)

        return failing

    session = await begun(place)
    robot = await place.robot().open()
    for name in ("move_database_log", "extend_sign_ins"):
        monkeypatch.setattr(periodic_tasks, name, fail(name))
    with monkeypatch.context() as patch:
        patch.setattr(LiveSession, "is_watched", property(fail("robots")))
        patch.setattr(LiveSession, "presence", fail("pages"))
        patch.setattr(LiveSession, "is_idle", property(fail("idle")))
        while len(failed) < 5 or min(failed.values()) < 2:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
    await robot.overhear()
    await robot.hear("heartbeat")
    await place.tablet(session).watch()
    told = {str(record.exc_info[1]) for record in caplog.records if record.exc_info}
    assert told == set(failed)


async def test_a_session_stays_in_memory_while_an_order_is_checked(
    place, elsewhere, ready, monkeypatch
):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.001)
    runtime = runtimes.current()
    session, other = await ready(place), await ready(elsewhere)
    checked = await runtime.session(session.pk)
    with checked.gate.closed():
        checked.recently_used = False
        await runtime.session(other.pk)
        async with asyncio.timeout(10):
            while other.pk in runtime.sessions:
                await turns()
        assert runtime.sessions[session.pk] is checked
    async with asyncio.timeout(10):
        while session.pk in runtime.sessions:
            await turns()
