"""Each setting takes the values at its bounds, and none beyond them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import pytest

from rehab.training.goal_adaptation import GoalAdaptation
from rehab.training.goals import Target
from rehab.training.measures import InvalidSetting, check_baseline_percent, check_gain
from rehab.training.phases import make_phase
from rehab.training.robot_cueing import CueTiming, check_activation_threshold
from rehab.training.schedules import Schedule, ScheduleKind

PHASE = partial(make_phase, "training")
SUMMARY = partial(Schedule, ScheduleKind.SUMMARY)


def field(build: Callable[..., object], name: str) -> Callable[[float], object]:
    """Return what sets one field of a new object and reads it back."""
    return lambda value: getattr(build(**{name: value}), name)


@pytest.mark.parametrize(
    ("set_to", "within", "beyond", "cure"),
    [
        (check_gain, (0.5, 0.85, 1.5), (0, 0.499, 1.501), "0.5 to 1.5"),
        (check_baseline_percent, (50, 200), (49.9, 200.1, -100), "50 to 200 %"),
        (check_activation_threshold, (0.01, 0.9, 2), (0, -0.9, 2.001, 90), "0.9 for 90 %"),
        (field(GoalAdaptation, "limit"), (0.001, 0.5), (0, 0.501), "up to 50 %"),
        (field(GoalAdaptation, "strides"), (5, 200), (4, 201), "5 to 200 strides"),
        (field(GoalAdaptation, "step"), (0.0001, 0.02), (0, 0.0201), "up to 2 % a stride"),
        (field(GoalAdaptation, "tolerance"), (0, 0.3), (-0.01, 0.301), "0 to 30 %"),
        (field(Schedule, "interval"), (1, 100), (0, 101), "1 to 100 steps"),
        (field(SUMMARY, "interval"), (2, 100), (1, 101), " steps"),
        (field(Schedule, "band"), (0.001, 0.5), (0, 0.501), "up to 50 %"),
        (field(Schedule, "stage"), (1, 1000), (0, 1001), "1 to 1000 steps"),
        (field(CueTiming, "window_s"), (2, 60), (1.9, 60.1), "2 to 60 seconds"),
        (field(CueTiming, "rest_s"), (0, 600), (-0.1, 600.1), "rests 0 to 600"),
        (field(CueTiming, "count"), (1, 100), (0, 101), "1 to 100 steps"),
        (field(Target, "hit_rate"), (0.01, 1), (0, 1.01, 60), "0.6 for 60 %"),
        (field(Target, "duration_s"), (0.1, 3600), (0, -1), "more than 0 seconds"),
        (field(PHASE, "strides"), (1, 1000), (0, -5), "at least 1 stride"),
        (field(PHASE, "seconds"), (0.1, 3600), (0, -1), "more than 0 seconds"),
        (field(PHASE, "gain"), (0.5, 1.5), (0.4, 1.6), "0.5 to 1.5"),
        (field(PHASE, "goal_percent"), (50, 200), (49, 201), "50 to 200 %"),
        (field(PHASE, "rest_s"), (0.1, 3600), (0, -1, 3600.1), "rest lasts more than 0"),
    ],
)
def test_a_setting_has_bounds(
    set_to: Callable[[float], float],
    within: tuple[float, ...],
    beyond: tuple[float, ...],
    cure: str,
) -> None:
    assert [set_to(value) for value in within] == list(within)
    is_count = all(isinstance(value, int) for value in (*within, *beyond))
    for value in (*beyond, *(() if is_count else (math.nan, math.inf))):
        with pytest.raises(InvalidSetting, match=cure):
            set_to(value)
