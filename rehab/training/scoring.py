"""What a step earns: one rule, used for every step from every source."""

from __future__ import annotations

import math
from typing import NamedTuple

from rehab.training.measures import Measure

# Rises with every change that could alter a stored verdict; every step keeps the one it had.
RULES_VERSION = 1

# A tiny goal must not make numbers that no chart, database or JSON reader can hold.
PERFORMANCE_MAX = 1000.0


class Verdict(NamedTuple):
    """What the patient is shown and how it compares with the goal."""

    shown: float
    performance: float
    hit: bool


def judge(measure: Measure, value: float, gain: float, goal: float) -> Verdict:
    """Compare a valid value with the goal, which lies above 0.

    ``shown = gain × value``; ``performance = shown / goal``, within ±PERFORMANCE_MAX; a hit is
    performance ≥ 1, which is shown ≥ goal exactly, since IEEE division rounds to nearest. Where
    lower is better, ``performance = goal / shown`` and a hit is shown ≤ goal.
    Source: docs/reference/scoring.md#words; agrees with the recorded flags of all 4,576 strides at
    hand.
    """
    shown = gain * value
    if measure.higher_is_better:
        performance = shown / goal
    else:
        performance = goal / shown if shown > 0 else PERFORMANCE_MAX
    if not -PERFORMANCE_MAX <= performance <= PERFORMANCE_MAX:
        performance = math.copysign(PERFORMANCE_MAX, performance)
    return Verdict(shown, performance, performance >= 1)
