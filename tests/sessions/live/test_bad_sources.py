"""Sources that may not, or not so: an error with a cure, the right code, and no harm to others."""

from __future__ import annotations

import os
import socket

import pytest
from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.log import Step
from tests.support.callers import (
    Message,
    RobotCaller,
    SourceCaller,
    a_step,
    change,
    numbers,
    turns,
)
from tests.support.world import set_owner

# --- tokens ---------------------------------------------------------------------------------------


async def test_tokens_that_open_no_source(place, begun, bystander):
    await begun(place)
    device = place.devices["source"]
    device.revoked_at = timezone.now()
    await sync_to_async(device.save)()
    hello = {"type": "hello", "version": 1, "run": "r", "last": 0}
    revoked = place.tokens["source"]
    for token in ("wrong", revoked, place.tokens["tablet"], place.tokens["robot"], "", "é"):
        by_header = await SourceCaller(token).dial()
        if not token:  # the same as none: the first frame may still bring one
            await by_header.say(hello)
        by_frame = await SourceCaller().dial()
        await by_frame.say(hello | {"token": token + "\ud800" * (token == "é")})
        for source in (by_header, by_frame):
            code, error = await source.sent_away()
            assert (code, error["code"]) == (4001, "token"), token
            assert "admin" in error["message"]


async def test_no_token_at_all(place):
    source = await SourceCaller().dial()
    await source.say(a_step(1))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4001, "token")


async def test_a_token_that_is_no_text(place):
    for token in (1, None, ["x"], {"a": 1}, True):
        for caller in (SourceCaller(), RobotCaller()):
            await caller.dial()
            await caller.say({"type": "hello", "version": 1, "base": "null", "token": token})
            assert (await caller.sent_away())[0] == 4001


# --- sessions -------------------------------------------------------------------------------------


async def test_a_finished_session_takes_no_more_steps(place, sourced, bystander):
    session, source = await sourced(place)
    await source.walk(4.0)
    await change(session, "finish")
    await source.say(a_step(1, 4.0))  # what it has already is still acknowledged
    await source.acked(1)
    await source.say(a_step(2))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4410, "ended")
    assert await numbers(session) == [1]


async def test_a_finished_session_that_is_named_in_hello(place, begun):
    session = await begun(place)
    await change(session, "finish")
    source = await place.source().dial()
    await source.say({"type": "hello", "version": 1, "run": "r", "last": 3, "session": session.pk})
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4410, "ended")


async def test_a_second_source_is_told_that_the_session_is_busy(place, begun, bystander):
    session = await begun(place)
    first = await place.source().open()
    second = await SourceCaller(place.tokens["source 0"]).dial()
    await second.say({"type": "hello", "version": 1, "run": "r", "last": 0})
    code, error = await second.sent_away()
    assert (code, error["code"]) == (4409, "busy")
    assert "Stop that one first" in error["message"]
    await first.walk(4.0)
    assert await numbers(session) == [1]


@pytest.mark.parametrize("kind", ["source", "robot"])
async def test_the_same_device_again_takes_over(place, begun, bystander, kind):
    session = await begun(place)
    dial = place.source if kind == "source" else place.robot
    first = await dial().dial()
    await first.hello()
    second = await dial().dial()
    await second.hello()
    assert (await first.sent_away())[0] == 4009
    live = await runtimes.current().session(session.pk)
    assert getattr(live, kind).device_id == place.devices[kind].pk
    if isinstance(second, SourceCaller):
        await second.walk(4.0)
        assert await numbers(session) == [1]


async def test_a_session_of_another_process(place, ready):
    session = await ready(place)
    parent = os.getppid()
    owner = f"{socket.gethostname()}|{parent}|{clinic_owners._start_time(parent)}"
    await sync_to_async(set_owner)(session.clinic_id, owner)
    for caller in (place.source(), place.robot(), place.tablet(session), place.monitor(session)):
        await caller.dial()
        await caller.say({"type": "hello", "version": 1, "run": "r", "last": 0, "base": "null"})
        code, error = await caller.sent_away()
        assert (code, error["code"]) == (4421, "elsewhere")
        assert str(parent) in error["message"]


# --- numbers --------------------------------------------------------------------------------------


async def test_a_gap(place, sourced, bystander):
    session, source = await sourced(place)
    await source.walk(4.0)
    await source.say({"type": "steps", "steps": [a_step(2), a_step(4)]})
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4400, "gap")
    assert "send 3 next" in error["message"]
    again = await place.source().open()
    await again.acked(2)
    assert await numbers(session) == [1, 2]


CONFLICTS: list[Message] = [
    {"value": 4.1},
    {"value": None},
    {"time_s": 9.0},
    {"side": "right"},
    {"reasons": ["slip"]},
    {"extra": {"x": 2}},
    {"extra": {}},
]


async def test_the_same_number_with_other_content(place, sourced, bystander):
    session, source = await sourced(place)
    await source.walk(4.0, extra={"x": 1})
    for other in CONFLICTS:
        await source.say(a_step(1, 4.0, extra={"x": 1}) | other)
        code, error = await source.sent_away()
        assert (code, error["code"]) == (4400, "conflict"), other
        assert "counts from 2" in error["message"]
        source = await place.source().open()
    assert await numbers(session) == [1]
    assert (await Step.everywhere.aget(session=session)).value == 4.0


# What was sent, by what becomes of it besides: the server adds doubts of its own.
DOUBTED: dict[str, Message] = {
    "two": {"value": 4.0, "reasons": ["slip", "cross_step"]},
    "out_of_bounds": {"value": 99.0, "reasons": ["slip"]},
    "missing": {"value": None, "reasons": ["slip"]},
    "own_doubt": {"value": 4.0, "reasons": ["paused"]},
    "own_clock": {"value": 4.0, "reasons": ["time_backwards"]},
    "backwards": {"value": 4.0, "time_s": -5.0, "reasons": ["slip"]},
    "backwards_alone": {"value": 4.0, "time_s": -5.0, "reasons": []},
}


@pytest.mark.parametrize("paused", [False, True], ids=["running", "paused"])
@pytest.mark.parametrize("sent", DOUBTED.values(), ids=list(DOUBTED))
async def test_the_same_number_with_fewer_or_other_reasons(place, sourced, sent, paused):
    session, source = await sourced(place)
    await source.walk(4.0)
    if paused:
        await change(session, "pause")
    step = a_step(2) | sent
    source.number = 2
    await source.say(step)
    await source.acked(2)
    reasons = step["reasons"]
    others = [reasons[:-1], reasons[1:], [*reasons, "other"], reasons[::-1]]
    # Of a step that came while the session was paused, "paused" says nothing that is not known.
    same = [reasons, []] if paused and reasons == ["paused"] else [reasons]
    for other in [other for other in others if other not in same]:
        await source.say(step | {"reasons": other})
        code, error = await source.sent_away()
        assert (code, error["code"]) == (4400, "conflict"), other
        source = await place.source().open()
        before = len(source.heard)
        await source.say(step)  # as it was: acknowledged again
        while source.heard[before:].count({"type": "ack", "number": 2}) < 1:
            await source.hear("ack")
    assert await numbers(session) == [1, 2]


async def test_other_content_while_the_first_is_on_its_way_to_the_disk(place, sourced, stall):
    session, source = await sourced(place)
    stall.begin()
    await source.say(a_step(1, 4.0))
    await source.say(a_step(1, 2.0))
    await turns()
    stall.end()
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4400, "conflict")
    assert (await Step.everywhere.aget(session=session)).value == 4.0


async def test_a_source_that_begins_anew_from_1_is_told_to_count_on(place, sourced, bystander):
    session, source = await sourced(place)
    await source.walk(4.0, 4.1)
    await source.hang_up()
    again = await place.source().open(run="r2")
    await again.say(a_step(1, 3.3))
    code, error = await again.sent_away()
    assert (code, error["code"]) == (4400, "conflict")
    assert "counts from 3" in error["message"]
    honest = await place.source().dial()
    assert (await honest.hello(run="r2"))["next"] == 3
    await honest.walk(3.3)
    assert await numbers(session) == [1, 2, 3]
