"""Plans: what a session is scored with, and how it is kept."""

from __future__ import annotations

import json
import math

import pytest

from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.goals import Target
from rehab.training.measures import A2, InvalidSetting, Measure
from rehab.training.phases import PHASE_KINDS, make_phase
from rehab.training.plans import SessionPlan
from rehab.training.valences import VALENCES
from tests.training.sessions import SWAY, make_plan, others_than


@pytest.mark.parametrize("measure", [A2, SWAY], ids=lambda measure: measure.slug)
@pytest.mark.parametrize("valence", VALENCES)
def test_a_plan_survives_being_stored(valence: str, measure: Measure) -> None:
    plan = make_plan(
        *(make_phase(kind, gain=0.85, strides=50, seconds=57.5) for kind in PHASE_KINDS),
        valence=valence,
        measure=measure,
        percent=118.0,
        target=Target(0.6, 600.0),
        activation_threshold=1.0,
        robot_intensity=0.5,
        gestures=({"name": "wave", "steps": [{"turn_rad": 0.5}, {"turn_rad": -0.5}]},),
        alternatives=others_than(valence),
        language="es",
    )
    again = SessionPlan.from_json(json.loads(json.dumps(plan.to_json(), allow_nan=False)))
    assert again == plan
    assert type(again.trained_side) is type(plan.trained_side)
    assert type(again.valence.bands[0].confetti) is type(plan.valence.bands[0].confetti)


def test_a_plan_from_before_alternatives_is_read_and_cannot_be_changed() -> None:
    plan = make_plan(make_phase("baseline"), make_phase("training"))
    stored = {
        name: value
        for name, value in json.loads(json.dumps(plan.to_json())).items()
        if name not in {"alternatives", "language"}
    }
    again = SessionPlan.from_json(stored)
    assert again == plan
    with pytest.raises(InvalidSetting, match="can be changed to one of: binary"):
        SessionFold(again).change(Change(ChangeKind.VALENCE, "positive"))


def test_a_plan_needs_a_phase() -> None:
    plan = make_plan()
    with pytest.raises(InvalidSetting, match="at least one phase"):
        SessionPlan(plan.measure, plan.valence, (), plan.trained_side, goal=plan.goal)


@pytest.mark.parametrize("goal", [0.0, 16.0, math.nan])
def test_a_goal_out_of_bounds_is_refused_with_the_plan(goal: float) -> None:
    with pytest.raises(InvalidSetting, match="above 0 and up to 15 W/kg"):
        make_plan(goal=goal)


def test_a_threshold_out_of_bounds_is_refused_with_the_plan() -> None:
    with pytest.raises(InvalidSetting, match="robot acts from more than 0"):
        make_plan(activation_threshold=90)


def test_a_robot_is_normal_gentle_or_off() -> None:
    with pytest.raises(InvalidSetting, match=r"normal \(1\), gentle \(0.5\), off \(0\)"):
        make_plan(robot_intensity=0.7)


@pytest.mark.parametrize("intensity", [0.0, 0.5])
@pytest.mark.parametrize("phase", [False, True])
def test_a_robot_takes_part_unless_it_is_off_and_no_phase_has_it(intensity, phase) -> None:
    plan = make_plan(make_phase("baseline", robot=phase), robot_intensity=intensity)
    assert plan.has_robot is (intensity > 0 or phase)


@pytest.mark.parametrize(
    "phases",
    [
        (make_phase("training"),),
        (make_phase("training"), make_phase("baseline")),
        (make_phase("catch"), make_phase("washout")),
        (make_phase("baseline", feedback=True), make_phase("training")),
    ],
)
def test_a_share_of_a_baseline_needs_a_baseline_before_feedback(phases) -> None:
    with pytest.raises(InvalidSetting, match="Put one first, or give the goal as a value"):
        make_plan(*phases, percent=100)
