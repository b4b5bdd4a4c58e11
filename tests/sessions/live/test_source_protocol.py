"""A source's good day: hello, welcome, steps, acks, and what the server says on its own."""

from __future__ import annotations

import asyncio

import pytest

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers.base import Socket
from rehab.sessions.setup.protocol_models import MeasureDefinition
from rehab.training.changes import Change, ChangeKind, PauseReason
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
from tests.support.callers import SourceCaller, a_step, change, rows_of, turns
from tests.support.world import NOW


async def test_hello_welcome_step_ack(place, begun):
    session = await begun(place, make_phase("training", gain=0.9))
    source = await place.source().dial()
    assert await source.hello(last=0, clock_s=12.5) == {
        "type": "welcome",
        "session": session.pk,
        "state": "running",
        "next": 1,
        "goal": 3.0,
        "trained_side": "left",
        "measure": "a2",
        "unit": "W/kg",
        "phase": {
            "kind": "training",
            "name": "Training",
            "feedback": True,
            "gain": 0.9,
            "valence": "binary",
        },
    }
    await source.say(a_step(1, 4.02, time_s=13.1, extra={"speed_m_s": 0.8}))
    assert await source.hear() == {"type": "ack", "number": 1}
    assert await rows_of(session, "number", "time_s", "side", "value", "hit", "extra") == [
        (1, 13.1, "left", 4.02, True, {"speed_m_s": 0.8})
    ]


async def test_a_token_may_come_in_the_first_frame(place, begun):
    session = await begun(place)
    source = await SourceCaller().dial()
    welcome = await source.hello(token=place.tokens["source"])
    assert welcome["session"] == session.pk
    await source.walk(4.0)


async def test_several_steps_in_one_frame_are_acked_together(place, sourced):
    session, source = await sourced(place)
    steps = [a_step(n, None if n == 2 else 4.0, reasons=["slip"] * (n == 3)) for n in range(1, 257)]
    await source.say({"type": "steps", "steps": steps})
    await source.acked(256)
    stored = await rows_of(session, "number", "valid", "reasons")
    assert len(stored) == 256
    assert stored[1:3] == [(2, False, ["missing"]), (3, False, ["slip"])]


async def test_an_ack_comes_after_the_commit(place, sourced, stall):
    session, source = await sourced(place)
    stall.begin()
    await source.say(a_step(1))
    assert await source.overhear() == []
    assert await rows_of(session, "number") == []
    stall.end()
    await source.acked(1)
    assert await rows_of(session, "number") == [1]


async def test_the_server_says_start_pause_resume_goal_phase_and_stop(place, ready):
    session = await ready(place, make_phase("training"), make_phase("catch"))
    source = await place.source().dial()
    assert (await source.hello())["state"] == "ready"
    for kind, value in (
        ("start", None),
        ("goal", 4.1),
        ("pause", None),
        ("resume", None),
        ("phase", 1),
        ("gain", 0.9),
        ("finish", None),
    ):
        await change(session, kind, value)
    await source.hear("stop")
    assert source.heard[1:] == [
        {"type": "start"},
        {"type": "goal", "goal": 4.1},
        {"type": "pause"},
        {"type": "resume"},
        {
            "type": "phase",
            "phase": {
                "kind": "catch",
                "name": "Catch",
                "feedback": False,
                "gain": 1.0,
                "valence": "binary",
            },
        },
        {"type": "stop"},
    ]
    assert source.code is None


async def test_stop_is_said_once_and_not_before_it_is_committed(place, sourced, stall):
    session, source = await sourced(place)
    live = await runtimes.current().session(session.pk)
    stall.begin()
    goal = live.change(Change(ChangeKind.GOAL, 3.5), None, NOW)
    end = live.change(Change(ChangeKind.ABORT), None, NOW)
    stall.end()
    await goal
    await end
    await source.hear("stop")
    await source.overhear()
    assert [m["type"] for m in source.heard[1:]] == ["goal", "stop"]


async def test_a_source_hears_of_a_goal_and_a_phase_that_steps_brought_about(place, begun):
    session = await begun(
        place,
        make_phase("baseline", strides=50),
        make_phase("training"),
        goal=GoalRule(percent_of_baseline=110),
    )
    source = await place.source().dial()
    assert (await source.hello())["goal"] is None
    await source.say({"type": "steps", "steps": [a_step(n, 4.0) for n in range(1, 51)]})
    await source.acked(50)
    await source.overhear()
    kinds = [message["type"] for message in source.heard]
    assert {"goal", "phase"} <= set(kinds)
    assert next(m for m in source.heard if m["type"] == "goal")["goal"] == pytest.approx(4.4)
    assert next(m for m in source.heard if m["type"] == "phase")["phase"]["kind"] == "training"
    assert await rows_of(session, "phase") == [0] * 50


async def test_steps_before_start_are_refused_and_the_socket_stays_open(place, ready):
    session = await ready(place)
    source = await place.source().open()
    await source.say(a_step(1))
    error = await source.hear("error")
    assert (error["code"], "Wait for start" in error["message"]) == ("not_running", True)
    await change(session, "start")
    await source.hear("start")
    await source.walk(4.0)


async def test_steps_of_a_paused_session_are_stored_as_invalid(place, sourced):
    session, source = await sourced(place)
    await source.walk(4.0)
    await change(session, "pause")
    await source.walk(4.0)
    await change(session, "resume")
    await source.walk(4.0)
    assert await rows_of(session, "valid", "reasons", "points") == [
        (True, [], 1),
        (False, ["paused"], None),
        (True, [], 1),
    ]


async def test_a_source_that_waits_at_its_station_is_welcomed_when_a_session_opens(
    place, ready, elsewhere
):
    source = await place.source().dial()
    assert await source.hello() == {"type": "welcome", "session": None}
    await source.say(a_step(1))
    assert (await source.hear("error"))["code"] == "no_session"
    await ready(elsewhere)
    await ready(place, at_station=False)
    assert await source.overhear() == []
    first = await ready(place)
    assert (await source.hear("welcome"))["session"] == first.pk
    await change(first, "start")
    await source.walk(4.0, 3.9)
    await change(first, "finish")
    await source.hear("stop")
    later = await ready(place)
    welcome = await source.hear("welcome")
    assert (welcome["session"], welcome["next"]) == (later.pk, 1)


async def test_a_session_opened_before_the_last_one_ended_is_taken_up_after_it(place, begun, ready):
    first = await begun(place)
    source = await place.source().open()
    second = await ready(place, beside=True)
    await turns()
    await source.walk(4.0)
    assert await rows_of(first, "number") == [1]
    await change(first, "finish")
    await source.hear("stop")
    assert (await source.hear("welcome"))["session"] == second.pk


async def test_a_source_may_name_one_of_its_stations_sessions(place, begun, ready):
    named = await begun(place)
    await ready(place, beside=True)
    source = await place.source().dial()
    assert (await source.hello(session=named.pk))["session"] == named.pk


async def test_the_same_step_again_is_acked_again(place, sourced):
    session, source = await sourced(place)
    await source.walk(4.0, 2.0, 3.0)
    await source.say(a_step(2, 2.0))
    assert await source.hear() == {"type": "ack", "number": 3}
    assert await rows_of(session, "number") == [1, 2, 3]


async def test_a_measure_may_be_an_extra_value_of_the_steps(place, begun):
    pulse = await MeasureDefinition.everywhere.acreate(
        clinic=place.patient.clinic, slug="pulse", name="heart rate", unit="1/min",
        channel="heart_rate", value_min=30, value_max=220, goal_min=40, goal_max=200,
    )  # fmt: skip
    session = await begun(place, measure=pulse, goal=GoalRule(value=100))
    source = await place.source().dial()
    assert (await source.hello())["unit"] == "1/min"
    steps = [a_step(1, 4.0, extra={"heart_rate": 104}), a_step(2, 4.1), a_step(3, None)]
    for step in [*steps, *steps]:  # the same ones again are the same
        await source.say(step)
        await source.hear()
    assert await rows_of(session, "value", "shown", "hit", "reasons", "extra") == [
        (104, 104, True, [], {"heart_rate": 104, "sent_value": 4.0}),
        (None, None, None, ["missing"], {"sent_value": 4.1}),
        (None, None, None, ["missing"], {}),
    ]
    await source.say(a_step(1, 4.0, extra={"heart_rate": 105}))
    assert (await source.hear())["code"] == "conflict"


async def test_the_same_step_again_while_it_is_on_its_way_is_no_error(place, sourced, stall):
    session, source = await sourced(place)
    stall.begin()
    for _ in range(3):
        await source.say(a_step(1))
    await turns()
    stall.end()
    await source.acked(1)
    await source.overhear()
    assert await rows_of(session, "number") == [1]


async def test_steps_are_sent_again_after_a_dropped_connection(place, sourced, stall):
    session, source = await sourced(place)
    await source.walk(4.0, 4.1)
    stall.begin()
    await source.say(a_step(3, 4.2))
    await turns()
    stall.end()
    await source.hang_up()
    again = await place.source().dial()
    welcome = await again.hello(last=5)
    assert 3 <= welcome["next"] <= 4
    for number in (3, 4, 5):
        await again.say(a_step(number, 4.0 + (number - 1) / 10))
    await again.acked(5)
    assert await rows_of(session, "number", "value") == [
        (1, 4.0),
        (2, 4.1),
        (3, 4.2),
        (4, 4.3),
        (5, 4.4),
    ]


async def test_presence_is_told_to_the_monitor(place, begun):
    session = await begun(place)
    monitor = place.monitor(session)
    assert (await monitor.watch())["presence"]["source"] is False
    source = await place.source().open()
    await monitor.until(lambda e: e["kind"] == "presence" and e["presence"]["source"])
    await source.hang_up()
    await monitor.until(lambda e: e["kind"] == "presence" and not e["presence"]["source"])


async def test_a_client_that_sent_nothing_but_its_token_may_wait_for_the_patient(
    place, begun, monkeypatch
):
    monkeypatch.setattr(Socket, "first_frame_s", 0.5)
    await begun(place)
    source = await SourceCaller().dial()
    await source.say({"token": place.tokens["source"]})
    await asyncio.sleep(0.6)
    await source.say("4, 3")
    await source.acked(1)


async def test_nothing_comes_before_the_welcome(place, begun):
    """Also where a page joins just then, and the session is paused by a server that came back."""
    session = await begun(place)
    live = await runtimes.current().session(session.pk)
    live.recently_used = False
    source = await place.source().dial()
    with live.gate.closed():  # a page is on its way in
        await source.say({"type": "hello", "version": 1, "run": "r1", "last": 0})
        async with asyncio.timeout(10):
            while not live.recently_used:
                await turns()
        await turns()
        await live.change(Change(ChangeKind.PAUSE, PauseReason.RESTART.value), None, NOW)
    assert (await source.hear())["type"] == "welcome"
    assert source.heard[0]["state"] == "paused"
