"""Measurements: what can be stored, and why one does not count."""

from __future__ import annotations

import math

import pytest

from rehab.training.measures import A2
from rehab.training.steps import (
    InvalidMeasurement,
    InvalidReason,
    Measurement,
    Side,
    find_invalid_reasons,
)
from tests.training.sessions import make_plan, start, step_at


@pytest.mark.parametrize("number", [0, -1])
def test_numbers_begin_at_1(number: int) -> None:
    with pytest.raises(InvalidMeasurement, match=f"begin at 1, not {number}"):
        Measurement(number, 0.0, Side.LEFT, 4.0)


@pytest.mark.parametrize("time_s", [math.nan, math.inf, -math.inf, 1.7e12, 1e308])
def test_a_time_is_in_seconds(time_s: float) -> None:
    with pytest.raises(InvalidMeasurement, match="Stride 7 needs a time in seconds"):
        Measurement(7, time_s, Side.LEFT, 4.0)


def test_seconds_since_1970_are_a_time() -> None:
    assert Measurement(1, 1.8e9, Side.LEFT, 4.0).time_s == 1.8e9


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_extra_values_are_finite(value: float) -> None:
    with pytest.raises(InvalidMeasurement, match="Stride 3: speed_m_s is not finite; leave it out"):
        Measurement(3, 0.0, Side.LEFT, 4.0, extra={"speed_m_s": value})


@pytest.mark.parametrize("value", [0.0, -0.0, 4, 20, 5e-324])
def test_a_value_within_bounds_counts(value: float) -> None:
    assert find_invalid_reasons(Measurement(1, 0.0, Side.LEFT, value), A2) == ()


@pytest.mark.parametrize(
    ("value", "stored"),
    [
        (None, (InvalidReason.MISSING,)),
        (-1.0, ("unsteady", InvalidReason.OUT_OF_BOUNDS)),
        (None, (InvalidReason.NOT_FINITE,)),  # it was NaN; None is what was stored of it
        (4.0, (InvalidReason.FLAGGED, InvalidReason.PAUSED)),
    ],
)
def test_reasons_are_not_given_twice(value: float | None, stored: tuple[str, ...]) -> None:
    assert find_invalid_reasons(Measurement(1, 0.0, Side.LEFT, value, stored), A2) == stored


@pytest.mark.parametrize("number", [1, 2, 4, 40])
def test_a_number_that_does_not_follow_is_refused_and_changes_nothing(number: int) -> None:
    fold = start(make_plan())
    step_at(fold, 1.0)
    step_at(fold, 2.0)
    with pytest.raises(InvalidMeasurement, match=f"Step {number} does not follow step 2; send 3"):
        fold.step(Measurement(number, 3.0, Side.LEFT, 4.0))
    assert (fold.last_number, fold.last_time_s, fold.trained.strides) == (2, 2.0, 2)


def test_a_clock_that_is_set_back_costs_one_step_and_no_time() -> None:
    fold = start(make_plan())
    for time_s in (1000.0, 1001.0):
        step_at(fold, time_s)
    assert step_at(fold, 0.5).reasons == (InvalidReason.TIME_BACKWARDS,)
    assert [step_at(fold, time_s).valid for time_s in (1.5, 2.5)] == [True, True]
    assert fold.active_s == 2.0
    assert fold.feedback.judged == 4


def test_a_step_out_of_order_adds_no_time() -> None:
    fold = start(make_plan())
    for time_s in (10.0, 3.0, 11.0, 12.0):
        step_at(fold, time_s)
    assert fold.active_s == 1.0


@pytest.mark.parametrize("times_s", [(0.06, 0.62, 0.62), (0.37, 1.41, 1.41), (-3.3, 0.1, 0.1)])
def test_two_steps_at_one_time_are_in_order(times_s: tuple[float, ...]) -> None:
    """A sum of differences would round past the time that it should be."""
    fold = start(make_plan())
    assert all(step_at(fold, time_s).valid for time_s in times_s)
