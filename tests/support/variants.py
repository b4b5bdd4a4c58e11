"""The variants of the robot's pools as cases: one of each path by default, all under `long`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from robot.behavior.cue import QUIET, QUIET_PACE
from robot.motion.gesture import Gesture
from robot.motion.gesture_variants import POOLS, TABLE, VARIANTS, variants

# A strong answer, one to a weak window, and one in a quiet room: share of the size, and pace.
LEVELS = {"full": (1.0, 1.0), "least": (0.5, 1.0), "gentle": (QUIET, QUIET_PACE)}


def at_level(gesture: Gesture, level: str) -> tuple[Gesture, float]:
    """Return a variant in the size in which it is performed at a level, and its pace."""
    share, pace = LEVELS[level]
    return gesture.scaled(max(share, gesture.least)), pace


def _first_of_each_path() -> set[str]:
    """Return names of variants that together show each path, to each side."""
    shown: dict[tuple[str, int], str] = {}
    for pool, performed in POOLS.items():
        rows = [(row.path, side) for row in TABLE[pool].rows for side in row.sides]
        for key, variant in zip(rows, performed, strict=True):
            shown.setdefault(key, variant.name)
    return set(shown.values())


SHOWN = _first_of_each_path()
GENTLE = {one.name for pool in POOLS for one in variants(pool, QUIET_PACE)}


def levels_of(name: str) -> list[str]:
    """Return the levels at which a gesture is performed; an idle motion is never scaled."""
    if name in VARIANTS:
        return [*LEVELS] if name in GENTLE else ["full", "least"]
    return ["full", "gentle"]


def cases(names: Iterable[str]) -> list[Any]:
    """Return gestures' names as cases; variants that `SHOWN` stand for are `long`."""
    rare = set(VARIANTS) - SHOWN
    return [pytest.param(name, marks=pytest.mark.long if name in rare else ()) for name in names]
