"""The gestures that every robot knows."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import MutableMapping
from functools import cache
from typing import cast

from robot.marking import gettext_noop
from robot.motion.gesture import Gesture, Waypoint, check_gesture
from robot.motion.gesture_variants import IDLE, POOLS, VARIANTS
from robot.motion.lights_and_sounds import FALLING, RISING
from robot.plugins import Registry, check_one
from robot.wire.cue_limits import VARIED

# Up to 3 s each, so that a base that answers late is home and still before the next window of 5 s
# ends, its announcement included. Out and back is what a patient sees of a round base; it goes out
# ahead, never backwards (no rear bumper).
CELEBRATE = Gesture(
    "celebrate",
    gettext_noop("Celebrate: a step ahead and a wiggle"),
    (
        Waypoint(0.05, 0.0, 0.0, within_s=1.4),
        Waypoint(0.05, 0.0, 0.17, within_s=1.2),
        Waypoint(0.05, 0.0, -0.17, within_s=1.4),
        Waypoint(0.0, 0.0, 0.0, within_s=2.2),
    ),
    RISING,
)
DROOP = Gesture(
    "droop",
    gettext_noop("Droop: turn away slowly and come back"),
    (
        Waypoint(0.0, 0.0, -0.45, within_s=2.5, pace=0.5, hold_s=0.5),
        Waypoint(0.0, 0.0, 0.0, within_s=2.0, pace=0.5),
    ),
    FALLING,
)
NOD = Gesture(
    "nod",
    gettext_noop("Nod: a little ahead and back, twice"),
    (
        Waypoint(0.04, 0.0, 0.0, within_s=1.2),
        Waypoint(0.0, 0.0, 0.0, within_s=1.2),
        Waypoint(0.04, 0.0, 0.0, within_s=1.2),
        Waypoint(0.0, 0.0, 0.0, within_s=1.2),
    ),
)
SWAY = Gesture(
    "sway",
    gettext_noop("Sway: left, right and back"),
    (
        Waypoint(0.0, 0.0, 0.4, within_s=1.5),
        Waypoint(0.0, 0.0, -0.4, within_s=2.0),
        Waypoint(0.0, 0.0, 0.0, within_s=1.5),
    ),
)


def _check(name: str, part: object) -> None:
    check_one(Gesture, "name")(name, part)
    check_gesture(cast(Gesture, part))


GESTURES: Registry[Gesture] = Registry(
    "garry.gestures", {one.name: one for one in (CELEBRATE, DROOP, NOD, SWAY)}, _check
)

# The original's three sequences (gesture_generation.py of 2024; docs/reference/original.md#robot),
# for replications. It ordered 0.2 m/s and 1.8 rad/s for 1 or 2 s each, without ramps; here are the
# places that these come to, at our limits, so they take longer. Its binary one ended 0.09 m behind
# home; ours goes on home from there.
_OUT_M, _SPIN_RAD = 0.2, 3.6
_LEFT_RAD = _SPIN_RAD / 2
_ASIDE = (_OUT_M * math.cos(_LEFT_RAD), _OUT_M * math.sin(_LEFT_RAD))
ORIGINAL_POSITIVE = Gesture(
    "original_positive",
    gettext_noop("The paper's positive: out, left, right, back"),
    (
        Waypoint(_OUT_M, 0.0, 0.0, within_s=3.4, hold_s=1.0),
        Waypoint(_OUT_M, 0.0, _SPIN_RAD, within_s=4.5),
        Waypoint(_OUT_M, 0.0, 0.0, within_s=4.5),
        Waypoint(0.0, 0.0, 0.0, within_s=2.5),
    ),
    RISING,
)
ORIGINAL_NEGATIVE = Gesture(
    "original_negative",
    gettext_noop("The paper's negative: spin left, spin right"),
    (Waypoint(0.0, 0.0, _SPIN_RAD, within_s=4.5), Waypoint(0.0, 0.0, 0.0, within_s=4.5)),
    FALLING,
)
ORIGINAL_BINARY = Gesture(
    "original_binary",
    gettext_noop("The paper's binary: left and ahead, right and ahead, left, home"),
    (
        Waypoint(0.0, 0.0, _LEFT_RAD, within_s=2.7),
        Waypoint(*_ASIDE, _LEFT_RAD, within_s=2.5),
        Waypoint(*_ASIDE, -_LEFT_RAD, within_s=4.5),
        Waypoint(2 * _ASIDE[0], 0.0, -_LEFT_RAD, within_s=2.5),
        Waypoint(2 * _ASIDE[0], 0.0, 0.0, within_s=2.7),
        Waypoint(0.0, 0.0, 0.0, within_s=1.7),
    ),
)

ORIGINALS: dict[str, Gesture] = {
    gesture.name: gesture for gesture in (ORIGINAL_POSITIVE, ORIGINAL_NEGATIVE, ORIGINAL_BINARY)
}

# All, by name.
BUILT_IN = ChainMap(
    VARIANTS,
    ORIGINALS,
    {one.name: one for one in IDLE},
    cast(MutableMapping[str, Gesture], GESTURES),
)


@cache
def known_names() -> frozenset[str]:
    """Return all that a cue may name: a gesture each time, of a pool another variant each time."""
    return frozenset({*BUILT_IN, *POOLS, VARIED})
