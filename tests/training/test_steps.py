"""Measurements: what can be stored, and why one does not count."""

from __future__ import annotations

import math

import pytest

from rehab.training.measures import A2, Measure
from rehab.training.scoring import RULES_VERSION
from rehab.training.steps import (
    InvalidMeasurement,
    InvalidReason,
    Measurement,
    Side,
    find_invalid_reasons,
    select_value,
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


PULSE = Measure("pulse", "heart rate", "1/min", 30, 220, 40, 200, channel="heart_rate")


@pytest.mark.parametrize(
    ("sent", "value", "extra"),
    [
        (
            Measurement(1, 0.0, Side.LEFT, 4.0, extra={"heart_rate": 90.0}),
            90.0,
            {"sent_value": 4.0},
        ),
        (Measurement(1, 0.0, Side.LEFT, None, extra={"heart_rate": 90.0}), 90.0, {}),
        (Measurement(1, 0.0, Side.LEFT, math.nan, extra={"heart_rate": 90.0}), 90.0, {}),
        (Measurement(1, 0.0, Side.LEFT, 4.0), None, {"sent_value": 4.0}),
    ],
)
def test_a_measure_with_a_channel_takes_its_value_from_there(sent, value, extra) -> None:
    selected = select_value(sent, PULSE)
    assert (selected.value, selected.extra) == (value, {**sent.extra, **extra})
    assert select_value(selected, PULSE) == selected
    assert select_value(sent, A2) is sent


def test_a_session_of_another_channel_is_scored_by_it() -> None:
    fold = start(make_plan(goal=100, measure=PULSE))
    steps = [Measurement(n, n, Side.LEFT, 4.0, extra={"heart_rate": 80.0 + 20 * n}) for n in (1, 2)]
    scored = [fold.step(step) for step in steps]
    assert [(step.shown, step.hit) for step in scored] == [(100.0, True), (120.0, True)]
    stored = [Measurement(s.number, s.time_s, s.side, s.value, s.reasons, s.extra) for s in scored]
    again = start(make_plan(goal=100, measure=PULSE))
    assert [again.step(step) for step in stored] == scored, "a replay gives the same"


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


# Two legs whose strides overtake each other, and what each version says of them.
OVERTAKEN = [(1.0, "left"), (1.6, "right"), (2.1, "left"), (2.05, "right"), (3.2, "left")]


@pytest.mark.parametrize(
    ("version", "doubted", "active_s"), [(1, [2.05], 1.1), (2, [], 2.2), (None, [], 2.2)]
)
def test_a_leg_may_be_overtaken_by_the_other_one(
    version: int | None, doubted: list[float], active_s: float
) -> None:
    fold = start(make_plan())
    steps = [
        fold.step(Measurement(number, time_s, Side(side), 4.0, rules_version=version))
        for number, (time_s, side) in enumerate(OVERTAKEN, 1)
    ]
    assert [step.time_s for step in steps if not step.valid] == doubted
    assert {step.rules_version for step in steps} == {version or RULES_VERSION}
    assert fold.active_s == pytest.approx(active_s)


def test_each_leg_notices_a_clock_that_was_set_back() -> None:
    fold = start(make_plan())
    for number, (time_s, side) in enumerate(
        [(1000.0, "left"), (1000.5, "right"), (0.5, "left"), (1.0, "right"), (1.6, "left")], 1
    ):
        step = fold.step(Measurement(number, time_s, Side(side), 4.0))
        backwards = (InvalidReason.TIME_BACKWARDS,) if number in (3, 4) else ()
        assert step.reasons == backwards
    assert fold.active_s == 0.5
