"""Honest resends are acknowledged, whatever a database's column makes of a number."""

from __future__ import annotations

import asyncio

import pytest

from rehab.sessions.log import Step
from tests.support.callers import a_step, numbers, turns

pytestmark = pytest.mark.postgres

STAMP = 1_760_000_000_123_456_789  # nanoseconds: more digits than a float has


@pytest.mark.parametrize("value", [STAMP, float(STAMP), -STAMP, 1e300, 0.1, 5, 5.0])
async def test_the_same_extra_is_the_same(place, sourced, value):
    session, source = await sourced(place)
    await source.walk(4.0, extra={"x": value})
    stored = (await Step.everywhere.aget(session=session)).extra["x"]
    assert stored == value if isinstance(value, int) else float(stored) == value
    await source.say(a_step(1, 4.0, extra={"x": value}))
    await source.acked(1)
    await source.say(a_step(1, 4.0, extra={"x": value + 1 if abs(value) < 1e15 else value * 2}))
    if isinstance(value, int) and abs(value) > 2**62:
        assert (await source.sent_away())[1]["code"] in ("bad_frame", "conflict")
    else:
        assert (await source.sent_away())[1]["code"] == "conflict"


async def test_a_neighbor_of_a_long_number_is_another_one(place, begun):
    await begun(place)
    source = await place.source().open()
    await source.walk(4.0, extra={"x": STAMP})
    await source.say(a_step(1, 4.0, extra={"x": STAMP + 1}))
    assert (await source.sent_away())[1]["code"] == "conflict"


async def test_a_number_that_could_not_be_kept_is_refused_with_the_cure(place, sourced):
    session, source = await sourced(place)
    await source.say(a_step(1, 4.0, extra={"x": 2**63}))
    code, error = await source.sent_away()
    assert code == 4400
    assert "send it as a decimal" in error["message"]
    assert await numbers(session) == []


async def test_plain_text_waits_for_acknowledgments_too(place, begun, stall):
    session = await begun(place)
    source = await place.source().dial()
    stall.begin()
    for _ in range(300):
        await source.say("4.0, 3.0")
    await turns(100)
    stall.end()
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4029, "flood")
    async with asyncio.timeout(10):
        while len(await numbers(session)) < 256:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    assert len(await numbers(session)) == 256
