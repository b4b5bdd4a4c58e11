"""A synthetic walker's strides in the measure that a session trains, and its goal as the walker's.

A walker's level is by its baseline, whatever is measured: a measure begins at its first goal, which
is a healthy walk's, and goes up, or down where less is better, as push-off goes up.
"""

from __future__ import annotations

from dataclasses import replace

from rehab.sources.synthetic.walker import SyntheticWalker
from rehab.training.measures import Measure
from rehab.training.steps import Measurement

LEVEL_MIN = 0.05


def show_goal(walker: SyntheticWalker, goal: float | None, measure: Measure) -> None:
    """Let a walker see the goal that is shown, in the unit of the measure."""
    if goal is None or not measure.channel:
        walker.goal_w_kg = goal
        return
    ratio = goal / measure.offered_goal
    walker.goal_w_kg = walker.profile.baseline_w_kg * (
        ratio if measure.higher_is_better else 1 / max(ratio, LEVEL_MIN)
    )


def express(stride: Measurement, walker: SyntheticWalker, measure: Measure) -> Measurement:
    """Return a walker's stride with the value of the measure in its channel, in place of A2."""
    if not measure.channel or stride.value is None:
        return stride
    level = max(stride.value / walker.profile.baseline_w_kg, LEVEL_MIN)
    value = measure.offered_goal * (level if measure.higher_is_better else 1 / level)
    value = min(max(value, measure.value_min), measure.value_max)
    return replace(stride, value=None, extra={measure.channel: round(value, 4)})
