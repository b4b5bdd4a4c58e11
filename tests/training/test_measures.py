"""Measures and the comparison with a goal."""

from __future__ import annotations

import dataclasses
import json
import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rehab.training.measures import (
    A2,
    GAIN_MAX,
    GAIN_MIN,
    MEASURES,
    PLATE_MEASURES,
    WORN,
    WORN_MEASURES,
    InvalidSetting,
    check_worn,
)
from rehab.training.scoring import judge
from robot.wire.limits import PERFORMANCE_MAX
from tests.training.sessions import SWAY

SIGNED = dataclasses.replace(A2, slug="signed", value_min=-20)
LOW_SIGNED = dataclasses.replace(SWAY, slug="low_signed", value_min=-50)

gains = st.floats(GAIN_MIN, GAIN_MAX)


@pytest.mark.parametrize("slug", MEASURES)
def test_every_measure_can_be_trained(slug: str) -> None:
    measure = MEASURES[slug]
    assert measure.slug == slug
    assert measure.name
    assert measure.unit
    assert measure.check_goal(measure.goal_max) == measure.goal_max
    shown = judge(measure, measure.goal_max, 1.0, measure.goal_max).shown
    assert shown == measure.goal_max <= measure.value_max, "its highest goal can be reached"


@pytest.mark.parametrize(
    ("most", "step", "places"),
    [(15, 0.05, 2), (200, 0.5, 1), (1.5, 0.005, 3), (3, 0.01, 2), (300, 1, 0), (1e5, 200, 0)],
)
def test_goals_are_raised_by_steps_of_some_three_hundred(most, step, places) -> None:
    measure = dataclasses.replace(A2, goal_max=most, first_goal=None)
    assert measure.goal_step == pytest.approx(step)
    assert measure.goal_places == places
    assert measure.check_goal(measure.offered_goal) == pytest.approx(most / 2, rel=0.02)


def test_the_first_goal_is_one_that_can_be_used() -> None:
    assert A2.offered_goal == 3.9
    with pytest.raises(InvalidSetting, match="A goal of 16 W/kg"):
        dataclasses.replace(A2, first_goal=16)


@pytest.mark.parametrize("goal", [5e-324, 0.1, 3.9, 15, 15.0])
def test_a_goal_within_bounds_is_a_number(goal: float) -> None:
    checked = A2.check_goal(goal)
    assert checked == goal
    assert type(checked) is float


@pytest.mark.parametrize("goal", [0, -0.0, -1, 15.001, 1e308, math.inf, -math.inf, math.nan])
def test_a_goal_out_of_bounds_is_refused_with_the_cure(goal: float) -> None:
    with pytest.raises(InvalidSetting, match=r"Give one above 0 and up to 15 W/kg\."):
        A2.check_goal(goal)


@pytest.mark.parametrize(
    "bounds",
    [
        {"value_min": 20},
        {"value_min": math.nan},
        {"value_max": math.inf},
        {"value_min": -1e300},
        {"goal_min": -1},
        {"goal_min": 15},
        {"goal_max": math.nan},
        {"goal_max": math.inf},
    ],
)
def test_a_measure_without_room_is_refused(bounds: dict[str, float]) -> None:
    with pytest.raises(InvalidSetting, match="ankle push-off power A2: "):
        dataclasses.replace(A2, **bounds)  # type: ignore[arg-type]


@given(st.floats(0, 20), gains, st.floats(0, 15, exclude_min=True))
@example(20.0, 1.5, 5e-324)
@example(5e-324, 0.5, 5e-324)
@example(math.nextafter(1, 0), 1.0, 1.0)
@example(math.nextafter(3.908, 0), 1.0, 3.908)
@example(-0.0, 1.0, 15.0)
def test_a_hit_is_a_shown_value_at_or_above_the_goal(
    value: float, gain: float, goal: float
) -> None:
    verdict = judge(A2, value, gain, goal)
    assert verdict.shown == gain * value
    assert verdict.hit == (verdict.shown >= goal) == (verdict.performance >= 1)
    assert 0 <= verdict.performance <= PERFORMANCE_MAX


@given(st.floats(0, 50), gains, st.floats(0, 40, exclude_min=True))
@example(0.0, 1.0, 40.0)
@example(5e-324, 0.5, 40.0)
def test_where_lower_is_better_a_hit_is_a_shown_value_at_or_below_the_goal(
    value: float, gain: float, goal: float
) -> None:
    verdict = judge(SWAY, value, gain, goal)
    assert verdict.shown == gain * value
    assert verdict.hit == (verdict.shown <= goal) == (verdict.performance >= 1)
    assert 0 <= verdict.performance <= PERFORMANCE_MAX


@pytest.mark.parametrize("measure", [SIGNED, LOW_SIGNED], ids=lambda measure: measure.slug)
@given(value=st.floats(-20, 20), gain=gains, goal=st.floats(0, 15, exclude_min=True))
@example(value=-20.0, gain=1.5, goal=5e-324)
def test_a_performance_fits_every_reader(measure, value, gain, goal) -> None:
    verdict = judge(measure, value, gain, goal)
    assert abs(verdict.performance) <= PERFORMANCE_MAX
    assert json.loads(json.dumps(verdict.performance)) == verdict.performance
    better = verdict.shown >= goal if measure.higher_is_better else verdict.shown <= goal
    assert verdict.hit == better


@pytest.mark.parametrize(("value", "performance"), [(10, 2.0), (20, 1.0), (40, 0.5), (0, 1000.0)])
def test_where_lower_is_better_performance_is_the_inverse(value: float, performance: float) -> None:
    assert judge(SWAY, value, 1.0, 20.0).performance == performance


@pytest.mark.parametrize("place", WORN)
def test_a_worn_sensor_measures_its_own_measures_and_never_a2(place: str) -> None:
    stride = {WORN[place]: 1.0, "stride_s": 1.1}
    for measure in WORN_MEASURES:
        assert not measure.sd_channel
        check_worn(stride, measure)
    check_worn({"a2_sd_w_kg": 0.1}, A2)
    for other in (A2, dataclasses.replace(A2, channel="stride_s"), SWAY):
        with pytest.raises(InvalidSetting, match="does not measure .* one of its own measures"):
            check_worn(stride, other)


@pytest.mark.parametrize("measure", [A2, *PLATE_MEASURES, *WORN_MEASURES], ids=lambda one: one.slug)
def test_each_shipped_measure_says_which_way_is_better_and_why(measure):
    way, _colon, why = measure.better.partition(": ")
    assert way == ("More is better" if measure.higher_is_better else "Less is better")
    assert why.endswith(".")


def test_what_never_comes_near_0_is_drawn_near_its_goal():
    spans = {one.slug: one.span for one in (A2, *PLATE_MEASURES, *WORN_MEASURES)}
    assert all(0 < span <= 1 for span in spans.values())
    assert (spans["a2"], spans["shank_stance"], spans["step_asymmetry"]) == (1, 0.2, 1)


def test_a_measure_of_a_clinics_own_says_which_way_is_better():
    own = dataclasses.replace(A2, slug="own", higher_is_better=False)
    assert own.better == "Less is better."
    assert dataclasses.replace(A2, higher_is_better=False).better == "Less is better."
