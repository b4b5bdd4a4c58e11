"""What a phone's browser says: units, rates and gaps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.support.node import run_node
from tests.support.simulated_leg import walk_foot


def events(rate_hz: float = 60, in_degrees: bool = True, seconds: float = 20) -> list[Any]:
    """Return a walk's events: time stamps [ms], accelerations, rates; with heel strikes."""
    t_s, rate, acceleration = walk_foot(seconds, rate_hz)
    acceleration[np.abs(t_s % 1.2 - 0.42) < 0.03] *= 2
    turns = np.degrees(rate) if in_degrees else rate
    rows = zip(t_s.tolist(), acceleration.tolist(), turns.tolist(), strict=True)
    return [[1000 * at_s, *axes] for at_s, *axes in rows]


@pytest.mark.parametrize("in_degrees", [True, False])
def test_rotation_is_read_in_either_unit(in_degrees: bool) -> None:
    read = run_node("read_motion.mjs", events(in_degrees=in_degrees))
    speeds = [math.hypot(*one["rate"]) for one in read["samples"][600:]]
    assert max(speeds) == pytest.approx(5.5, abs=0.1)
    assert read["rate_hz"] == pytest.approx(60, abs=0.1)
    assert read["trouble"] == ""


def test_a_slow_phone_and_a_gap_are_noticed_for_a_while() -> None:
    slow = run_node("read_motion.mjs", events(rate_hz=30))
    assert (slow["trouble"], slow["later"]) == ("slow", "")
    walk = events()
    with_gap = [row for row in walk if not 18_000 < row[0] < 18_400]
    assert run_node("read_motion.mjs", with_gap)["trouble"] == "gap"
    early = [row for row in walk if not 5_000 < row[0] < 5_400]
    assert run_node("read_motion.mjs", early)["trouble"] == ""


def test_events_without_rotation_are_left_out() -> None:
    read = run_node("read_motion.mjs", [[0, [0, 0, 9.8], None], [16, None, [0, 0, 0]]])
    assert read["samples"] == [None, None]
