"""Strides of worn sensors: scored as what they are, refused as A2."""

from __future__ import annotations

from asgiref.sync import sync_to_async

from rehab.sessions.log import Step
from rehab.sessions.setup.protocols import MeasureDefinition
from rehab.training.goals import GoalRule
from tests.support.callers import a_step, numbers

STRIDE = {"wearable_foot": 1, "foot_strike_deg": 21.5, "push_off_deg_s": 380.0, "stride_s": 1.2}


async def test_the_server_refuses_a2_from_a_worn_sensor(place, sourced, bystander):
    session, source = await sourced(place)
    await source.walk(4.0)
    for worn in ("wearable_foot", "wearable_shank"):
        for value in (4.0, None):
            caller = await place.source().open()
            await caller.say(a_step(2, value, extra={worn: 1}))
            code, error = await caller.sent_away()
            assert (code, error["code"]) == (4400, "not_measured")
            assert "foot strike angle" in error["message"]
    assert await numbers(session) == [1]


async def test_a_worn_sensors_own_measure_is_scored(place, sourced):
    measure = await MeasureDefinition.everywhere.aget(clinic=None, slug="foot_strike")
    session, source = await sourced(place, measure=measure, goal=GoalRule(value=20.0))
    await source.walk(None, extra=STRIDE)
    await source.walk(None, extra=STRIDE, reasons=["turning"])
    first, second = [
        step async for step in Step.everywhere.filter(session=session).order_by("number")
    ]
    assert (first.value, first.valid, first.hit) == (21.5, True, True)
    assert (second.valid, second.reasons, second.hit) == (False, ["turning"], None)
    assert await sync_to_async(lambda: first.extra["wearable_foot"])() == 1
