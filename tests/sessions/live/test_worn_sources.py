"""Strides of worn sensors: scored as what they are, refused as A2."""

from __future__ import annotations

import time

from asgiref.sync import sync_to_async

from rehab.sessions.log import Step
from rehab.sessions.setup.protocol_models import MeasureDefinition
from rehab.stations.models import Device
from rehab.training.goals import GoalRule
from tests.support.callers import SourceCaller, a_step, numbers

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


async def test_the_therapist_sees_what_is_wrong_with_a_sensor(place, sourced):
    measure = await MeasureDefinition.everywhere.aget(clinic=None, slug="foot_strike")
    session, source = await sourced(place, measure=measure, goal=GoalRule(value=20.0))
    monitor, tablet = await place.monitor(session).open(), await place.tablet(session).open()
    for trouble in ("hidden", ""):
        await source.say({"type": "sensor", "trouble": trouble})
        await monitor.until(
            lambda e, it=trouble: e["kind"] == "presence" and e["presence"]["source_trouble"] == it
        )
    await tablet.overhear()
    told = [event for event in tablet.events if event["kind"] == "presence"]
    assert all("source_trouble" not in event["presence"] for event in told)
    await source.say({"type": "sensor", "trouble": "tired"})
    assert (await source.sent_away())[0] == 4400


async def test_the_therapist_sees_what_plays_instead_of_a_leg(place, sourced):
    session, source = await sourced(place)
    monitor = await place.monitor(session).open()
    for what in ("recording", "simulated"):
        await source.say({"type": "sensor", "trouble": "", "plays": what})
        await monitor.until(
            lambda e, it=what: e["kind"] == "presence" and e["presence"]["source_plays"] == it
        )
    await source.say({"type": "sensor", "trouble": "", "plays": "recording", "round": 2})
    await monitor.until(lambda e: e["kind"] == "presence" and e["presence"]["source_round"] == 2)
    await source.say({"type": "sensor", "trouble": "", "plays": "music"})
    assert (await source.sent_away())[0] == 4400


async def test_the_end_of_a_recording_outlives_its_source(place, sourced):
    session, source = await sourced(place)
    monitor, tablet = await place.monitor(session).open(), await place.tablet(session).open()

    def is_told(trouble, *, is_there):
        def judge(event):
            presence = event.get("presence", {})
            told = (presence.get("source_trouble"), presence.get("source"))
            return event["kind"] == "presence" and told == (trouble, is_there)

        return judge

    for trouble in ("hidden", "ended"):
        await source.say({"type": "sensor", "trouble": trouble})
        await monitor.until(is_told(trouble, is_there=True))
    await source.hang_up()
    await monitor.until(is_told("ended", is_there=False))
    await tablet.until(lambda event: event.get("presence", {}).get("ended"))
    again = await place.source().open()
    await monitor.until(is_told("", is_there=True))
    await again.say({"type": "sensor", "trouble": "hidden"})
    await monitor.until(is_told("hidden", is_there=True))
    await again.hang_up()
    await monitor.until(is_told("", is_there=False))


async def test_a_phone_asks_for_the_time(place, sourced):
    _, source = await sourced(place)
    before_s = time.monotonic()
    times = []
    for asked_s in (12.5, 12.6):
        await source.say({"type": "clock", "asked_s": asked_s})
        answer = await source.hear("clock")
        assert answer["asked_s"] == asked_s
        times.append(answer["at_s"])
    assert times[0] > 1.7e9  # seconds since 1970
    assert 0 <= times[1] - times[0] <= time.monotonic() - before_s


async def test_a_sensor_on_the_other_leg_brings_contacts_alone(place, sourced):
    """Both are there at once; what it measures is no step, and reaches the trained leg's sensor."""
    session, source = await sourced(place)
    monitor = await place.monitor(session).open()
    device = await Device.everywhere.aget(pk=place.devices["source"].pk)
    device.pk, device.name = None, "Phone, right shin"
    token = device.new_token()
    await device.asave(force_insert=True)
    other = SourceCaller(token)
    await other.dial()
    assert (await other.hello(side="right"))["is_companion"]
    await other.say(
        {"type": "sensor", "trouble": "", "clock_offset_s": 0.2, "clock_error_s": 0.003}
    )
    seen = await monitor.until(
        lambda e: e["kind"] == "presence" and e["presence"]["companion_clock"]
    )
    assert seen["presence"]["companion_clock"] == [0.2, 0.003]
    assert seen["presence"]["source"]
    await other.say({"type": "contact", "at_s": 1000.5, "error_s": 0.003})
    assert (await source.hear("contact"))["at_s"] == 1000.5
    await source.walk(4.0)
    await other.say(a_step(1, None, extra={"wearable_shank": 1}))
    assert (await other.sent_away())[1]["code"] == "other_leg"
    assert await numbers(session) == [1]
