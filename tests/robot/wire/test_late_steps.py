"""Clocks that are heard over a network: slow, set back, held up, or all at once."""

from __future__ import annotations

import random
from itertools import count, takewhile

import pytest

from robot.wire.remote_clock import DRIFT_MAX, LATE_STEP_S, RemoteClock

HOUR_S = 3600.0
STRIDE_S = 1.1
SLOW = 0.005  # a ceramic resonator


def times(until_s: float) -> list[float]:
    return list(takewhile(lambda t: t < until_s, (STRIDE_S * n for n in count(1))))


@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0])
@pytest.mark.parametrize("is_told", [True, False])
@pytest.mark.parametrize("drift", [-SLOW, -0.003, -0.0001, 0.0, 0.0001, SLOW])
def test_no_drift_makes_an_hours_walk_late(drift, is_told, speed):
    delays = random.Random(1)
    clock = RemoteClock(speed, 0.0 if is_told else None)
    for time_s in times(HOUR_S):
        heard_s = time_s + delays.uniform(0.02, 3.0)
        assert not clock.observe(speed * (1 + drift) * time_s, heard_s)
    shown_s = clock.read_s(HOUR_S)
    assert shown_s is not None
    assert abs(shown_s / speed - (1 + drift) * HOUR_S) < 3.0


def test_what_is_held_up_is_late_after_an_hour_of_drift():
    clock = RemoteClock(time_s=0.0)
    for time_s in times(HOUR_S):
        assert not clock.observe((1 - SLOW) * time_s, time_s + 0.02)
    assert clock.observe((1 - SLOW) * HOUR_S, HOUR_S + LATE_STEP_S + 0.2)


@pytest.mark.parametrize("back_s", [LATE_STEP_S + STRIDE_S + 0.1, 3600.0, 1e9])
@pytest.mark.parametrize("is_told", [True, False])
def test_a_clock_that_was_set_back_is_fresh_at_once_and_late_when_held_up(back_s, is_told):
    clock = RemoteClock(time_s=back_s if is_told else None)
    walked = times(60.0)
    assert not any(clock.observe(back_s + t, t) for t in walked)
    assert not any(clock.observe(walked[-1] + t, walked[-1] + t) for t in walked)
    assert clock.observe(121.0, 121.0 + LATE_STEP_S + 0.2)


@pytest.mark.parametrize("out_s", [60.0, 600.0])
def test_what_was_stored_for_ten_minutes_is_late(out_s):
    clock = RemoteClock(time_s=0.0)
    walked = times(60.0 + out_s)
    live = [t for t in walked if t < 60]
    assert not any(clock.observe(t, t) for t in live)
    back_s = walked[-1]
    fresh = [t for t in walked if t >= 60 and not clock.observe(t, back_s)]
    allowed_s = LATE_STEP_S + DRIFT_MAX * (back_s - live[-1])
    assert fresh == [t for t in walked if back_s - t <= allowed_s]
    assert not clock.observe(back_s + 1.0, back_s + 1.0)
    assert clock.observe(back_s + 1.0, back_s + 2.0 + LATE_STEP_S)


def test_two_legs_in_no_strict_order_are_no_clock_that_was_set_back():
    clock = RemoteClock(time_s=0.0)
    both = [t for n in range(1, 300) for t in (n + 0.6, n + 0.0)]
    assert all(clock.observe(t, 600.0) for t in both)
