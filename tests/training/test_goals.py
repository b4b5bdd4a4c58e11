"""Goals: where they come from, and what is wanted of a whole session."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from rehab.training.changes import Change, ChangeKind, NotAllowed
from rehab.training.goals import MIN_BASELINE_STRIDES, GoalRule, Target
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from tests.training.sessions import make_plan, start, walk


def start_with_baseline(percent=100.0, strides=50):
    return start(
        make_plan(make_phase("baseline", strides=strides), make_phase("training"), percent=percent)
    )


def test_a_goal_is_a_value_or_a_share_of_the_baseline() -> None:
    with pytest.raises(InvalidSetting, match="either as a value or as percent"):
        GoalRule()
    with pytest.raises(InvalidSetting, match="either as a value or as percent"):
        GoalRule(value=4.0, percent_of_baseline=100.0)


@pytest.mark.parametrize("percent", [49.9, 200.1, 0.0, -100.0, math.nan, math.inf])
def test_a_share_that_makes_no_sense_is_refused(percent: float) -> None:
    with pytest.raises(InvalidSetting, match="Give 50 to 200 %"):
        GoalRule(percent_of_baseline=percent)


def test_a_rule_gives_its_goal_once_it_can() -> None:
    assert GoalRule(value=4).resolve(A2, None) == 4.0
    assert GoalRule(value=4).resolve(A2, 3.0) == 4.0
    share = GoalRule(percent_of_baseline=118.0)
    assert share.needs_baseline
    assert share.resolve(A2, None) is None
    assert share.resolve(A2, 3.0) == pytest.approx(3.54)
    with pytest.raises(InvalidSetting, match="A goal of 20 W/kg cannot be used"):
        GoalRule(percent_of_baseline=200.0).resolve(A2, 10.0)


def test_the_goal_is_the_mean_of_fifty_valid_baseline_strides() -> None:
    assert MIN_BASELINE_STRIDES == 50
    fold = start_with_baseline()
    steps = walk(fold, [3.0, 5.0] * 25)
    assert {(step.goal, step.performance, step.hit, step.valid) for step in steps} == {
        (None, None, None, True)
    }
    assert (fold.goal, fold.phase_index, fold.obstacle) == (4.0, 1, "")
    (step,) = walk(fold, [4.0])
    assert (step.goal, step.hit, step.points) == (4.0, True, 1)


def test_a_trials_goal_needs_fewer_baseline_strides() -> None:
    rule = GoalRule(percent_of_baseline=100.0, baseline_strides=5)
    plan = replace(make_plan(make_phase("baseline", strides=6), make_phase("training")), goal=rule)
    fold = start(plan)
    walk(fold, [4.0] * 4)
    walk(fold, [19.0, 19.0], reasons=("flagged",))
    assert (fold.goal, fold.phase_index) == (None, 0)
    assert "needs 5 valid baseline strides and has 4" in fold.obstacle
    walk(fold, [4.0])
    assert (fold.goal, fold.phase_index) == (4.0, 1)


@pytest.mark.parametrize("percent", [50.0, 85.0, 118.0, 200.0])
def test_the_goal_is_a_percentage_of_the_baseline(percent: float) -> None:
    fold = start_with_baseline(percent)
    walk(fold, [4.0] * 50)
    assert fold.goal == pytest.approx(4.0 * percent / 100)


def test_with_49_valid_strides_the_session_waits_and_says_why() -> None:
    fold = start_with_baseline()
    walk(fold, [4.0] * 49)
    walk(fold, [19.0], reasons=("flagged",))
    assert (fold.goal, fold.phase_index) == (None, 0)
    assert fold.obstacle == (
        "The goal needs 50 valid baseline strides and has 49. Walk on, or set the goal as a value."
    )
    walk(fold, [None, math.nan, -1.0])
    walk(fold, [4.0], side=Side.RIGHT)
    assert fold.phase_index == 0
    walk(fold, [4.0])
    assert (fold.goal, fold.phase_index, fold.obstacle) == (4.0, 1, "")


def test_baseline_strides_while_paused_do_not_count() -> None:
    fold = start_with_baseline()
    walk(fold, [4.0] * 49)
    fold.change(Change(ChangeKind.PAUSE))
    walk(fold, [19.0])
    fold.change(Change(ChangeKind.RESUME))
    walk(fold, [4.0])
    assert fold.goal == 4.0


def test_several_baselines_count_together() -> None:
    fold = start(
        make_plan(
            make_phase("baseline", strides=30),
            make_phase("baseline", strides=30),
            make_phase("training"),
            percent=100,
        )
    )
    walk(fold, [3.0] * 30 + [5.0] * 30)
    assert (fold.goal, fold.phase_index) == (4.0, 2)


def test_a_warm_up_before_the_baseline_needs_no_goal() -> None:
    fold = start(
        make_plan(
            make_phase("familiarization", feedback=False, strides=1),
            make_phase("catch", strides=1),
            make_phase("baseline", strides=50),
            make_phase("training"),
            percent=100,
        )
    )
    walk(fold, [9.0, 9.0])
    assert (fold.phase_index, fold.obstacle) == (2, "")
    walk(fold, [4.0] * 50)
    assert (fold.phase_index, fold.goal) == (3, 4.0)


def test_the_pt_cannot_skip_a_baseline_that_is_needed() -> None:
    fold = start_with_baseline()
    walk(fold, [4.0] * 10)
    with pytest.raises(NotAllowed, match=r"has 10\. Walk on, or set the goal as a value"):
        fold.change(Change(ChangeKind.PHASE, 1))
    fold.change(Change(ChangeKind.GOAL, 3.0))
    fold.change(Change(ChangeKind.PHASE, 1))
    assert (fold.phase_index, fold.goal) == (1, 3.0)


def test_the_goal_that_the_pt_sets_wins_over_the_baseline() -> None:
    fold = start_with_baseline()
    fold.change(Change(ChangeKind.GOAL, 3.0))
    (step, *_) = walk(fold, [4.0] * 50)
    assert (step.hit, step.points) == (True, None)
    assert (fold.goal, fold.phase_index) == (3.0, 1)


def test_a_goal_by_the_pt_clears_the_way_at_once() -> None:
    fold = start_with_baseline(strides=10)
    walk(fold, [4.0] * 10)
    assert fold.obstacle
    fold.change(Change(ChangeKind.GOAL, 3.0))
    assert not fold.obstacle
    walk(fold, [4.0])
    assert (fold.phase_index, fold.obstacle) == (1, "")


@pytest.mark.parametrize(("value", "goal"), [(0.0, "0"), (10.0, "20")])
def test_a_baseline_that_gives_no_usable_goal_waits_for_the_pt(value: float, goal: str) -> None:
    fold = start_with_baseline(percent=200)
    walk(fold, [value] * 60)
    assert (fold.goal, fold.phase_index) == (None, 0)
    assert fold.obstacle.startswith(f"A goal of {goal} W/kg cannot be used")
    fold.change(Change(ChangeKind.GOAL, 15.0))
    walk(fold, [value])
    assert fold.phase_index == 1


@pytest.mark.parametrize(
    ("target", "hit_rate", "active_s", "met"),
    [
        (Target(), 1.0, 9999.0, None),
        (Target(0.6, 600), 0.6, 600.0, True),
        (Target(0.6, 600), 0.59, 600.0, False),
        (Target(0.6, 600), 0.6, 599.0, False),
        (Target(0.6, 600), None, 600.0, False),
        (Target(hit_rate=1.0), 1.0, 0.0, True),
        (Target(duration_s=600), None, 600.0, True),
    ],
)
def test_sixty_percent_of_the_steps_over_ten_minutes(
    target: Target, hit_rate: float | None, active_s: float, met: bool | None
) -> None:
    assert target.is_met(hit_rate, active_s) is met
