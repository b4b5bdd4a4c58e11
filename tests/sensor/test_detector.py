"""The phone's detector and that of the sources decide alike, on the same samples."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rehab.gait import WearableDetector
from tests.support.node import run_node
from tests.support.simulated_leg import (
    Floats,
    random_mounting,
    stand,
    stretch_a_swing,
    walk_foot,
)
from tests.support.worn_sensors import captured_walks, stroke_walks, turning_walks

Samples = tuple[Floats, Floats, Floats]
ALIKE_S = 0.001


def compare(place: str, samples: Samples) -> int:
    """Check that both find the same strides; return how many."""
    t_s, rate, acceleration = samples
    detector = WearableDetector(place)
    ours = detector.feed(t_s, rate, acceleration)
    table = np.column_stack((t_s, acceleration, rate)).tolist()
    found = run_node("detect_strides.mjs", {"place": place, "samples": table})
    assert found["isInDoubt"] is detector.is_in_doubt
    assert (found["left"] or ()) == pytest.approx(detector.left or (), abs=1e-6)
    assert len(found["strides"]) == len(ours)
    for theirs, own in zip(found["strides"], ours, strict=True):
        assert theirs["reasons"] == [str(one) for one in own.reasons]
        for name in ("initial_contact_s", "terminal_contact_s", "stride_s", "stance_s"):
            assert theirs[name] == pytest.approx(getattr(own, name), abs=ALIKE_S), name
        assert theirs["rate_hz"] == pytest.approx(own.rate_hz)
        for name in ("foot_strike_rad", "push_off_rad_s", "shank_lean_rad"):
            assert theirs[name] == pytest.approx(getattr(own, name), abs=1e-4), name
    return len(ours)


def plain(seed: int) -> Samples:
    t_s, rate, acceleration = walk_foot(40, rate_hz=60)
    matrix = random_mounting(seed)
    return t_s, rate @ matrix.T, acceleration @ matrix.T


def with_gaps() -> Samples:
    t_s, rate, acceleration = walk_foot(60)
    kept = ~((np.abs(t_s - 24.4) < 0.031) | (np.abs(t_s - 36) < 0.2))
    return t_s[kept], rate[kept], acceleration[kept]


def turned_over() -> Samples:
    t_s, rate, acceleration = walk_foot(60)
    later = t_s > 30
    matrix = np.diag([1.0, -1.0, -1.0])
    rate[later], acceleration[later] = rate[later] @ matrix, acceleration[later] @ matrix
    rate[(t_s > 15) & (t_s < 17), 2] += 1.5
    return t_s, rate, acceleration


def stood_before() -> Samples:
    t_s, rate, acceleration = walk_foot(40)
    still = t_s < 3
    rate[still], acceleration[still] = stand(t_s[still])
    return t_s, rate, acceleration


def in_doubt() -> Samples:
    """A leg that goes nowhere and never rests; then it lifts its toes."""
    t_s = np.arange(0, 45, 0.01)
    rate, acceleration = stand(t_s, 0.0)
    rate[:, 1] = 3 * np.sin(2 * np.pi * t_s) * (t_s < 30)
    phase = (t_s - 35) / 0.8
    lifted = (phase > 0) & (phase < 1)
    rate[lifted, 1] = -0.349 * math.pi / 0.8 * np.sin(2 * np.pi * phase[lifted])
    return t_s, rate, acceleration


@pytest.mark.parametrize(
    ("place", "make", "least"),
    [
        ("foot", lambda: plain(1), 30),
        ("foot", lambda: plain(2), 30),
        ("foot", with_gaps, 45),
        ("foot", turned_over, 40),
        ("shank", stood_before, 25),
        ("foot", in_doubt, 1),
        ("foot", lambda: stretch_a_swing(24.0), 30),
        ("foot", lambda: (np.arange(0, 9, 0.01), *stand(np.arange(0, 9, 0.01))), 0),
    ],
    ids=[
        "mounted one way",
        "another",
        "gaps",
        "turned over",
        "shank",
        "in doubt",
        "unclear contact",
        "standing",
    ],
)
def test_simulated_legs(place: str, make: Callable[[], Samples], least: int) -> None:
    assert compare(place, make()) >= least


@pytest.mark.parametrize(
    ("walks", "least"),
    [
        (lambda: stroke_walks("pp03_002_right"), 121),
        (lambda: stroke_walks("pp01_000_leftshank"), 58),
        (lambda: turning_walks("5-2", "7-1"), 14),
        (captured_walks, 29),
    ],
    ids=["stroke", "unclear contacts", "turns", "healthy"],
)
def test_real_legs(walks: Callable, least: int) -> None:  # type: ignore[type-arg]
    for walk in walks():
        assert compare(walk.place, (walk.t_s, walk.rate, walk.acceleration)) >= least
