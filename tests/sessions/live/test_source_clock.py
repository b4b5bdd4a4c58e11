"""Steps that were held up on their way are stored and counted, and never shown as live."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from rehab.sessions.live.consumers import source as source_module
from rehab.sessions.live.session.delayed_steps import SourceClock
from rehab.sessions.log import Step
from robot.wire.remote_clock import DRIFT_MAX, LATE_STEP_S
from tests.support.callers import a_step, change


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0, 10.0])
def test_lateness_is_told_by_the_clock_in_hello(speed):
    def is_late(time_s, now_s):
        return SourceClock("r", 100.0, clock_s=50.0, speed=speed).is_late(time_s, now_s)

    slack = LATE_STEP_S * max(1.0, speed)
    assert not is_late(50.0, 100.0)
    assert not is_late(50.0 + 10 * speed, 110.0)
    assert not is_late(50.0 - slack, 100.0)
    assert is_late(50.0 - slack - 0.01, 100.0)
    assert is_late(50.0, 100.0 + (1 + 2 * DRIFT_MAX) * slack / speed)


def test_nothing_is_late_at_full_speed():
    clock = SourceClock("r", 100.0, clock_s=50.0, speed=None)
    assert not clock.is_late(-1e9, 1e9)


def test_without_a_clock_the_quickest_step_stands_for_a_fresh_one():
    clock = SourceClock("r", 0.0, clock_s=None, speed=1.0)
    assert not clock.is_late(7.0, 3.0)
    assert not clock.is_late(8.0, 9.0)
    assert clock.is_late(9.0, 10.1)
    assert not clock.is_late(20.0, 10.2)
    assert clock.is_late(20.0, 15.3)


def test_a_clock_that_was_told_late_is_corrected_by_a_quicker_step():
    clock = SourceClock("r", 0.0, clock_s=0.0, speed=1.0)
    assert not clock.is_late(3.0, 0.0)
    assert clock.is_late(3.0, 5.1)


def test_a_clock_that_stood_still_with_the_session_makes_nothing_late():
    clock = SourceClock("r", 0.0, clock_s=0.0, speed=1.0, clock_pauses=True)
    assert not clock.is_late(1.0, 1.0)
    clock.resume()  # the session goes on after half a minute
    assert not clock.is_late(2.0, 32.0)
    assert clock.is_late(3.0, 38.1)  # and what is late from then on is late


def test_a_clock_that_went_on_with_the_session_is_not_excused_by_a_pause():
    clock = SourceClock("r", 0.0, clock_s=0.0, speed=1.0)
    clock.resume()
    assert clock.is_late(1.0, 80.0)


def test_late_steps_tell_nothing_of_the_clock():
    clock = SourceClock("r", 0.0, clock_s=0.0, speed=1.0)
    assert [clock.is_late(t, 60.0) for t in (1.0, 2.0, 54.0)] == [True, True, True]
    assert not clock.is_late(56.0, 60.0)


@pytest.mark.parametrize("tells_its_clock", [True, False])
async def test_steps_resent_after_a_minute_offline(place, begun, monkeypatch, tells_its_clock):
    now = SimpleNamespace(s=1000.0)
    clock = SimpleNamespace(monotonic=lambda: now.s, time=lambda: now.s)
    monkeypatch.setattr(source_module, "time", clock)
    session = await begun(place)
    tablet, monitor, robot = (
        await place.tablet(session).open(),
        await place.monitor(session).open(),
        await place.robot().open(),
    )
    source = await place.source().open(**({"clock_s": 0.0} if tells_its_clock else {}))
    for number in range(1, 4):
        now.s = 1000.0 + number
        await source.walk(4.0, time_s=float(number))
    await source.hang_up()
    now.s += 60.0  # the source walks on alone
    again = await place.source().dial()
    told = {"clock_s": 63.0} if tells_its_clock else {}
    assert (await again.hello(last=63, **told))["next"] == 4
    await again.say(
        {"type": "steps", "steps": [a_step(n, 4.0, time_s=float(n)) for n in range(4, 64)]}
    )
    await again.acked(63)
    again.number = 63
    now.s += 1.0
    await again.walk(4.0, time_s=64.0)
    await tablet.until_step(64)
    await monitor.until_step(64)
    fresh = [1, 2, 3, *range(58, 65)]  # those of the last five seconds are fresh
    for page in (tablet, monitor):
        steps = [event for event in page.events if event["kind"] == "step"]
        assert [event["number"] for event in steps] == list(range(1, 65))
        assert [event["number"] for event in steps if event["live"]] == fresh
    assert tablet.last("step")["score"] == 64
    await robot.overhear()
    assert [m["number"] for m in robot.heard if m["type"] == "step"] == fresh
    assert await Step.everywhere.filter(session=session, hit=True).acount() == 64


async def test_a_device_that_begins_anew_is_live_again_at_once(place, begun):
    session = await begun(place)
    tablet, robot = await place.tablet(session).open(), await place.robot().open()
    source = await place.source().open(clock_s=1000.0)
    for time_s in (1000.1, 1000.2, 1000.3, 0.1, 0.2, 0.3):
        await source.walk(4.0, time_s=time_s)
    await tablet.until_step(6)
    steps = [event for event in tablet.events if event["kind"] in ("step", "missing")]
    assert [event["live"] for event in steps] == [True] * 6
    await robot.overhear()  # the fourth does not count: its time runs backwards
    assert [m["number"] for m in robot.heard if m["type"] == "step"] == [1, 2, 3, 5, 6]


@pytest.mark.parametrize(
    ("told", "fresh"), [({}, [1, 3]), ({"clock_pauses": True}, [1, 2, 3])], ids=["sensor", "played"]
)
async def test_after_a_pause_steps_of_before_are_late_unless_the_clock_stood(
    place, begun, monkeypatch, told, fresh
):
    now = SimpleNamespace(s=1000.0)
    clock = SimpleNamespace(monotonic=lambda: now.s, time=lambda: now.s)
    monkeypatch.setattr(source_module, "time", clock)
    session = await begun(place)
    tablet, robot = await place.tablet(session).open(), await place.robot().open()
    source = await place.source().open(clock_s=0.0, **told)
    await source.walk(4.0, time_s=0.0)
    now.s += 5.0
    await change(session, "pause")
    now.s += 25.0
    await change(session, "resume")
    await source.walk(4.0, time_s=5.0)  # measured before the pause
    await source.walk(4.0, time_s=30.0)
    await tablet.until_step(3)
    steps = [event for event in tablet.events if event["kind"] == "step"]
    assert [event["number"] for event in steps if event["live"]] == fresh
    await robot.overhear()
    assert [m["number"] for m in robot.heard if m["type"] == "step"] == fresh


async def test_a_played_source_that_was_away_when_its_session_went_on_is_live(
    place, begun, monkeypatch
):
    """Its clock stood until it came back: nobody can say since when."""
    now = SimpleNamespace(s=1000.0)
    monkeypatch.setattr(source_module, "time", SimpleNamespace(monotonic=lambda: now.s))
    session = await begun(place)
    tablet = await place.tablet(session).open()
    source = await place.source().open(clock_s=0.0, clock_pauses=True)
    await source.walk(4.0, time_s=0.0)
    await change(session, "pause")
    await source.hang_up()
    await change(session, "resume")
    now.s += 30.0
    again = await place.source().dial()
    assert (await again.hello(last=1, clock_pauses=True))["next"] == 2
    for number in (2, 3):
        now.s += 10.0  # until it hears that it may play
        await again.say({"type": "step"} | a_step(number, 4.0, time_s=10.0 * number))
    await again.acked(3)
    await tablet.until_step(3)
    steps = [event for event in tablet.events if event["kind"] == "step"]
    assert [event["live"] for event in steps] == [True] * 3


async def test_what_a_source_calls_late_is_never_live_and_tells_nothing_of_its_clock(place, begun):
    """A source that started again sends what its journal kept, by a clock that is gone."""
    session = await begun(place)
    tablet, robot = await place.tablet(session).open(), await place.robot().open()
    source = await place.source().open()
    kept = [a_step(n, 4.0, time_s=5000.0 + n) | {"late": True} for n in range(1, 4)]
    await source.say({"type": "steps", "steps": kept})
    await source.say({"type": "step"} | a_step(4, 4.0, time_s=5004.0) | {"late": True})
    await source.acked(4)
    source.number = 4
    await source.walk(4.0, time_s=5600.0)  # another clock, which shows less than that would now
    await tablet.until_step(5)
    steps = [event for event in tablet.events if event["kind"] == "step"]
    assert [event["live"] for event in steps] == [False] * 4 + [True]
    await robot.overhear()
    assert [m["number"] for m in robot.heard if m["type"] == "step"] == [5]
    assert await Step.everywhere.filter(session=session, hit=True).acount() == 5
    await source.say({"type": "step"} | a_step(6, 4.0, time_s=5601.0) | {"late": 1})
    code, error = await source.sent_away()
    assert code == 4400
    assert '"late"' in error["message"]
