"""Scoring: how a value compares with its goal. One rule, for every step from every source."""

from __future__ import annotations

import math
from typing import NamedTuple

from rehab.training.closeness import CloseSteps
from rehab.training.measures import Measure
from rehab.training.steps import Measurement, ScoredStep, Side
from rehab.training.valences import Valence
from robot.wire.limits import PERFORMANCE_MAX

# Rises with every change that could alter a stored verdict; every step stores its version, and is
# folded by it again. Versions:
# 1: a step before the last one, whichever leg, has a clock that ran backwards.
# 2: a step before the last one of its leg (the legs' strides may overtake each other).
# 3: steps may be close, where the plan has it; before, none was.
# 4: so may those of measures whose standard deviation is known, though no step holds it.
RULES_VERSION = 4
CLOSE_SINCE, TYPICAL_SINCE = 3, 4
NO_CLOSE_STEPS = CloseSteps()


class Verdict(NamedTuple):
    """What the patient is shown and how it compares with the goal.

    Attributes
    ----------
    shown
        The value after the gain, in its unit.
    performance
        Its share of the goal (ratio).
    hit
        Whether the goal was reached: performance ≥ 1.
    """

    shown: float
    performance: float
    hit: bool


def judge(measure: Measure, value: float, gain: float, goal: float) -> Verdict:
    """Return how a valid value compares with the goal.

    ``shown = gain × value``; ``performance = shown / goal``, within ±PERFORMANCE_MAX; a hit is
    performance ≥ 1, which is shown ≥ goal exactly, since IEEE division rounds to nearest. Where
    lower is better, ``performance = goal / shown`` and a hit is shown ≤ goal.
    Source: docs/reference/scoring.md#words; agrees with the recorded flags of all 4,576 strides at
    hand.

    Parameters
    ----------
    measure
        What is trained.
    value, goal
        In its unit, the goal above 0.
    gain
        Of the phase (ratio).
    """
    shown = gain * value
    if measure.higher_is_better:
        performance = shown / goal
    else:
        performance = goal / shown if shown > 0 else PERFORMANCE_MAX
    if not -PERFORMANCE_MAX <= performance <= PERFORMANCE_MAX:
        performance = math.copysign(PERFORMANCE_MAX, performance)
    return Verdict(shown, performance, performance >= 1)


def score_measurement(
    measurement: Measurement,
    reasons: tuple[str, ...],
    *,
    measure: Measure,
    trained_side: Side,
    phase: int,
    gain: float,
    goal: float | None,
    valence: Valence | None,
    close_steps: CloseSteps = NO_CLOSE_STEPS,
    rules_version: int = RULES_VERSION,
) -> ScoredStep:
    """Return a measurement with its verdict and points.

    Parameters
    ----------
    measurement
        As the source sent it.
    reasons
        Why it is invalid; then it is neither judged nor rewarded.
    measure, trained_side
        What is trained, and the leg whose steps are judged.
    phase, gain
        Index and gain (ratio) of the phase that it belongs to.
    goal
        In the measure's unit; None while it is unknown.
    valence
        What rewards it; None in a phase without feedback.
    close_steps
        Which steps are too uncertain to earn or cost points.
    rules_version
        Of the rules that it is scored by.
    """
    value = measurement.value
    shown = performance = hit = points = None
    close = False
    if reasons:
        if value is not None and not math.isfinite(value):
            value = None
    elif value is not None and goal is not None and measurement.side == trained_side:
        shown, performance, hit = judge(measure, value, gain, goal)
        sd = measurement.extra.get(measure.sd_channel)
        if sd is None and rules_version >= TYPICAL_SINCE:
            sd = measure.typical_sd
        if rules_version >= CLOSE_SINCE:
            close = close_steps.includes(shown, None if sd is None else gain * sd, goal)
        if valence is not None:
            points = valence.points(hit, close)
    return ScoredStep(
        number=measurement.number,
        time_s=measurement.time_s,
        side=measurement.side,
        value=value,
        gain=gain,
        shown=shown,
        goal=goal,
        performance=performance,
        hit=hit,
        close=close,
        points=points,
        valid=not reasons,
        reasons=reasons,
        phase=phase,
        extra=measurement.extra,
        rules_version=rules_version,
    )
