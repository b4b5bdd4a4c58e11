"""Pages that join: a snapshot, then exactly what is missing, however fast each reads."""

from __future__ import annotations

import random

import pytest

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.protocol.past_steps import PAGE_STEPS
from rehab.sessions.live.session import subscribers
from rehab.training.phases import make_phase
from tests.support.callers import (
    Caller,
    Message,
    Page,
    PatientPage,
    a_step,
    change,
    turns,
)

PHASES = (
    make_phase("training", strides=4),
    make_phase("catch", strides=2),
    make_phase("training", gain=0.9),
)
TOTALS = [
    *("number", "state", "score", "phase", "goal", "gain", "hit_rate"),
    *("activation_threshold", "robot_intensity"),
]


def apply(page: Page) -> Message:
    """Return a page's totals: its first snapshot and all events after it."""
    totals = dict(page.heard[0])
    for event in page.events:
        match event["kind"]:
            case "step":
                totals |= {
                    name: event[name]
                    for name in ("number", "score", "streak", "hit_rate")
                    if name in event
                }
            case "missing" | "calm":
                totals["number"] = event["number"]
            case "state":
                totals["state"] = event["state"]
            case "phase":
                totals |= {k: event[k] for k in ("phase", "goal", "gain", "obstacle") if k in event}
            case "goal" | "gain":
                totals[event["kind"]] = event[event["kind"]]
            case "activation_threshold" | "robot_intensity":
                totals[event["kind"]] = event["value"]
    return totals


async def test_a_tablet_hears_no_session_from_before_the_last_one(place, ready):
    session = await ready(place)
    await change(session, "start")
    await change(session, "finish")
    tablet = place.tablet(session)
    assert (await tablet.watch())["state"] == "finished"  # it has just ended
    await tablet.hang_up()
    following = await ready(place)
    await change(following, "start")
    tablet = await place.tablet(session).dial()
    assert (await tablet.sent_away())[0] == 4004


async def test_a_tablet_hears_an_ended_session_until_the_next_one_starts(place, ready):
    session = await ready(place)
    await change(session, "start")
    tablet, monitor = await place.tablet(session).open(), await place.monitor(session).open()
    await change(session, "finish")
    await runtimes.current().routines.check_sign_ins()
    await tablet.overhear()
    assert tablet.code is None
    await change(await ready(place), "start")
    await runtimes.current().routines.check_sign_ins()
    assert (await tablet.sent_away())[0] == 4001
    await monitor.overhear()
    assert monitor.code is None


@pytest.mark.parametrize("valence", ["positive", "negative", "binary", "explicit"])
async def test_snapshot_and_events_give_a_fresh_snapshot(place, ready, valence):
    chance = random.Random(f"live {valence}")
    session = await ready(place, *PHASES, valence=valence)
    source = await place.source().open()
    pages = [place.tablet(session), place.monitor(session)]
    for page in pages:
        await page.watch()
    await change(session, "start")
    for round_ in range(40):
        kinds = ["goal", "gain", "pause", "phase", "threshold", "robot"]
        kind = chance.choice(["step"] * 6 + kinds)
        if kind == "step":
            value = chance.choice([None, 2.0, 3.0, 4.0, 99.0])
            await source.walk(value, side=chance.choice(["left", "left", "right"]))
        elif kind == "pause":
            await change(session, "pause")
            await source.walk(4.0)
            await change(session, "resume")
        elif kind == "phase":
            await change(session, "phase", chance.randrange(3))
        elif kind == "threshold":
            await change(session, "activation_threshold", chance.choice([0.8, 0.9]))
        elif kind == "robot":
            await change(session, "robot_intensity", chance.choice([0, 0.5, 1]))
        else:
            await change(session, kind, {"goal": 3.5, "gain": 1.1}[kind])
        if round_ % 8 == 7:
            for page in pages:
                await page.overhear()
                fresh = type(page)(session.pk, user=place.pt)
                shown = await fresh.watch()
                names = [name for name in TOTALS if name in shown]
                totals = apply(page)
                if isinstance(page, PatientPage):
                    # The patient hears nothing of the other leg's steps, not even their number.
                    names.remove("number")
                assert {n: totals[n] for n in names} == {n: shown[n] for n in names}
                await fresh.hang_up()


async def test_after_gives_exactly_the_missing_steps_once(place, sourced):
    session, source = await sourced(place)
    count = 600
    for first in range(1, count, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    for after, page in (
        (0, place.tablet(session, "?after=0")),
        (577, place.monitor(session, "?after=577")),
    ):
        assert (await page.watch())["number"] == count
        await page.overhear()
        while len([m for m in page.heard if m["type"] == "steps"]) < (3 if after == 0 else 1):
            await page.hear("steps")
        frames = [m for m in page.heard if m["type"] == "steps"]
        got = [step["number"] for frame in frames for step in frame["steps"]]
        assert got == list(range(after + 1, count + 1))
        assert [frame["frame"] for frame in frames] == list(range(1, len(frames) + 1))
    up_to_date = await place.tablet(session, f"?after={count}").open()
    source.number = count
    await source.walk(4.0)
    await up_to_date.until_step(count + 1)
    assert not [m for m in up_to_date.heard if m["type"] == "steps"]


@pytest.mark.long
async def test_a_long_past_is_fed_as_fast_as_it_is_read(place, sourced):
    """A page asks for 5,000 steps and reads slowly; a page beside it notices nothing."""
    session, source = await sourced(place)
    count = 5_000
    for first in range(1, count, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    source.number = count
    beside = await place.monitor(session).open()
    slow = await place.tablet(session, "?after=0").open()
    while len(frames_of_past(slow)) < subscribers.MAX_UNCONFIRMED_BACKLOG:
        await slow.hear("steps")
    await source.walk(*[4.0] * 20)
    await beside.until_step(count + 20)
    await Caller.overhear(slow)
    past = frames_of_past(slow)
    assert len(past) == subscribers.MAX_UNCONFIRMED_BACKLOG  # not one more before it has read one
    assert max(len(frame["steps"]) for frame in past) <= PAGE_STEPS
    while len(numbers_of(slow)) < count:
        await slow.say({"type": "seen", "frame": frames_of_past(slow)[-1]["frame"]})
        await slow.hear("steps")
    await slow.until_step(count + 20)
    assert numbers_of(slow) == list(range(1, count + 21))


async def test_a_page_that_reads_none_of_its_past_is_let_go(place, sourced, monkeypatch):
    monkeypatch.setattr(subscribers, "CONFIRM_TIMEOUT_S", 0.05)
    session, source = await sourced(place)
    for first in range(1, 2000, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    page = await place.tablet(session, "?after=0").open()
    code, error = await page.sent_away()
    assert (code, error["code"]) == (4008, "unseen")
    live = await runtimes.current().session(session.pk)
    assert not live.feed.subscribers


def frames_of_past(page: Page) -> list[Message]:
    return [message for message in page.heard if message["type"] == "steps"]


def numbers_of(page: Page) -> list[int]:
    old: list[int] = [s["number"] for m in page.heard if m["type"] == "steps" for s in m["steps"]]
    return old + page.steps


async def test_nothing_is_missed_or_doubled_when_a_page_joins_under_way(place, sourced):
    session, source = await sourced(place)
    pages = []
    for number in range(1, 60):
        await source.say(a_step(number))
        if number % 10 == 0:
            page = await place.tablet(session, "?after=0").dial()
            pages.append(page)
    await source.acked(59)
    for page in pages:
        await page.hear("snapshot")
        while len(numbers_of(page)) < 59:
            await page.hear()
        snapshot, *_ = [m for m in page.heard if m["type"] == "snapshot"]
        old = [s["number"] for m in page.heard if m["type"] == "steps" for s in m["steps"]]
        assert numbers_of(page) == list(range(1, 60))
        assert old == list(range(1, snapshot["number"] + 1))


async def test_nothing_is_shown_before_it_is_committed(place, sourced, stall):
    session, source = await sourced(place)
    tablet, robot = await place.tablet(session).open(), await place.robot().open()
    await turns()
    stall.begin()
    await source.say(a_step(1))
    await turns()
    late_comer = await place.monitor(session).dial()
    assert [m["type"] for m in await late_comer.overhear()] == []
    assert not tablet.steps
    await tablet.overhear()
    assert not tablet.steps
    stall.end()
    await tablet.until_step(1)
    await robot.hear("step")
    assert (await late_comer.hear("snapshot"))["number"] == 1


async def test_a_slow_page_gets_fewer_and_larger_frames(place, sourced):
    session, source = await sourced(place)
    slow, quick = place.tablet(session), place.monitor(session)
    slow.confirms = False
    await slow.watch()
    await quick.watch()
    for _ in range(subscribers.MAX_UNCONFIRMED + 30):
        await source.walk(4.0)
        await quick.until_step(source.number)
    await slow.overhear()
    frames = [m for m in slow.heard if m["type"] == "events"]
    assert len(frames) == subscribers.MAX_UNCONFIRMED
    await slow.say({"type": "seen", "frame": frames[-1]["frame"]})
    await slow.until_step(source.number)
    frames = [m for m in slow.heard if m["type"] == "events"]
    assert len(frames) == subscribers.MAX_UNCONFIRMED + 1
    assert len(frames[-1]["events"]) >= 28
    assert slow.steps == quick.steps == list(range(1, source.number + 1))


async def test_a_page_that_confirms_nothing_is_sent_away_alone(place, sourced, monkeypatch):
    monkeypatch.setattr(subscribers, "CONFIRM_TIMEOUT_S", 0.02)
    session, source = await sourced(place)
    deaf, quick = await place.tablet(session).open(), await place.monitor(session).open()
    for _ in range(subscribers.MAX_UNCONFIRMED + 2):
        await source.walk(4.0)
        await quick.until_step(source.number)
    code, error = await deaf.sent_away()
    assert (code, error["code"]) == (4008, "unseen")
    assert "?after=" in error["message"]
    await source.walk(4.0)
    await quick.until_step(source.number)
    live = await runtimes.current().session(session.pk)
    assert len(live.feed.subscribers) == 1


async def test_a_page_that_lags_beyond_the_ring_begins_anew(place, sourced):
    session, source = await sourced(place)
    slow = place.tablet(session)
    slow.confirms = False
    await slow.watch()
    for _ in range(subscribers.MAX_UNCONFIRMED):
        await source.walk(4.0)
    for first in range(source.number + 1, source.number + 600, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    await slow.overhear()
    assert slow.heard[-1]["type"] == "events"
    await slow.say({"type": "seen", "frame": slow.heard[-1]["frame"]})
    snapshot = await slow.hear("snapshot")
    assert snapshot["number"] == 632
    assert snapshot["score"] == 632
    assert [step["number"] for step in snapshot["steps"]] == list(range(573, 633))
    source.number = 632
    await source.walk(2.0)
    assert (await slow.until_step(633))["score"] == 631
