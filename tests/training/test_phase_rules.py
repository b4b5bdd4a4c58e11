"""What a phase brings along: its goal, the rest after it, a baseline's goal that is accepted."""

from statistics import mean, stdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.training.changes import Change, ChangeKind, PauseReason, State
from rehab.training.fold.tallies import Tally
from rehab.training.goals import GoalRule
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.plans import SessionPlan
from rehab.training.robot_cueing import CueTiming, check_activation_threshold
from rehab.training.steps import Side
from rehab.training.valences import find_valence
from robot.behavior.cue import Cue
from robot.wire.cue_limits import CueRule
from robot.wire.frames import BadFrame
from tests.training.sessions import make_plan, start, walk

BASELINE = make_phase("baseline", strides=50)


def test_a_phase_sets_its_goal_in_percent_of_the_baseline():
    fold = start(
        make_plan(
            BASELINE,
            make_phase("training", strides=5, goal_percent=110),
            make_phase("training", goal_percent=120),
            goal=3.0,
        )
    )
    walk(fold, [4.0] * 50)
    assert fold.goal == pytest.approx(4.4)
    walk(fold, [4.0] * 5)
    assert fold.goal == pytest.approx(4.8)


def test_a_goal_by_baseline_needs_one_before_it():
    with pytest.raises(InvalidSetting, match="no baseline comes before it"):
        make_plan(make_phase("training", goal_percent=110), BASELINE)
    with pytest.raises(InvalidSetting, match="Give 50 to 200 %"):
        make_phase("training", goal_percent=300)
    with pytest.raises(InvalidSetting, match="a rest lasts"):
        make_phase("training", rest_s=0)


def test_a_rest_pauses_the_session_until_somebody_goes_on():
    fold = start(
        make_plan(make_phase("training", strides=3, rest_s=60), make_phase("training", strides=3))
    )
    walk(fold, [5.0] * 3)
    assert (fold.state, fold.pause_reason, fold.rest_s) == (State.PAUSED, PauseReason.REST, 60)
    assert fold.phase_index == 1
    (during,) = walk(fold, [5.0])
    assert during.reasons == ("paused",)
    assert fold.phase_strides == 0
    fold.change(Change(ChangeKind.RESUME))
    assert (fold.state, fold.rest_s) == (State.RUNNING, None)
    walk(fold, [5.0])
    assert fold.phase_strides == 1


def test_a_therapist_goes_on_without_the_rest_and_repeats_a_phase():
    fold = start(make_plan(make_phase("training", strides=3, rest_s=60), make_phase("training")))
    walk(fold, [5.0] * 2)
    fold.change(Change(ChangeKind.PHASE, 0))
    assert fold.phase_strides == 0
    walk(fold, [5.0] * 2)
    fold.change(Change(ChangeKind.PHASE, 1))
    assert fold.state is State.RUNNING
    assert fold.phases[0].strides == 4


def test_the_last_phase_has_no_rest_after_it():
    fold = start(make_plan(make_phase("training", strides=2, rest_s=60)))
    walk(fold, [5.0] * 2)
    assert fold.completed
    assert fold.state is State.RUNNING


def test_a_baseline_waits_for_its_goal_to_be_accepted():
    plan = SessionPlan(
        measure=A2,
        valence=find_valence("positive"),
        phases=(BASELINE, make_phase("training")),
        trained_side=Side.LEFT,
        goal=GoalRule(percent_of_baseline=100, asks=True),
    )
    fold = start(SessionPlan.from_json(plan.to_json()))
    walk(fold, [4.0] * 60)
    assert fold.phase_index == 0
    assert "to accept its goal" in fold.obstacle
    fold.change(Change(ChangeKind.PHASE, 1))
    assert (fold.phase_index, fold.goal, fold.obstacle) == (1, 4.0, "")


@given(st.lists(st.floats(0, 20), min_size=2, max_size=60), st.integers(0, 60))
def test_mean_and_sd_are_those_of_the_textbook(values, cut):
    plan = make_plan(make_phase("baseline"))
    steps = walk(start(plan), values)
    whole, first, rest = Tally(), Tally(), Tally()
    for number, step in enumerate(steps):
        whole.add(step)
        (first if number < cut else rest).add(step)
    first.merge(rest)
    assert whole.mean_value == pytest.approx(mean(values))
    assert whole.sd_value == pytest.approx(stdev(values), abs=1e-9)
    assert first.sd_value == pytest.approx(stdev(values), abs=1e-9)


@pytest.mark.parametrize(("first", "second"), [("hhhm", "hhm"), ("hhm", "hhhm"), ("hh", "hhm")])
def test_the_longest_row_of_hits_lies_in_one_of_the_parts(first, second):
    parts = []
    for hits in (first, second):
        fold = start(make_plan())
        walk(fold, [5.0 if one == "h" else 3.0 for one in hits])
        parts.append(fold.feedback)
    whole, other = parts
    whole.merge(other)
    assert (whole.best_streak, whole.streak) == (max(first.count("h"), second.count("h")), 0)


def test_one_value_has_no_sd():
    fold = start(make_plan(make_phase("baseline")))
    walk(fold, [4.0])
    assert fold.trained.sd_value is None


SENT = {"threshold": 0.9, "window_s": 5, "rest_s": 5, "count": 5, "intensity": 1}


@pytest.mark.parametrize(
    ("name", "least", "most", "by"),
    [("window_s", 2, 60, 0.01), ("rest_s", 0, 600, 0.01), ("count", 1, 100, 1)],
)
def test_plans_and_robots_have_the_same_limits(name, least, most, by):
    for figure in (least, most):
        assert getattr(CueTiming(**{name: figure}), name) == figure
        assert getattr(Cue.read(SENT | {name: figure}), name) == figure
    for figure in (least - by, most + by):
        with pytest.raises(InvalidSetting):
            CueTiming(**{name: figure})
        with pytest.raises(BadFrame, match=name):
            Cue.read(SENT | {name: figure})


def test_plans_and_robots_have_the_same_thresholds_and_rules():
    assert check_activation_threshold(2) == Cue.read(SENT | {"threshold": 2}).threshold
    with pytest.raises(InvalidSetting):
        check_activation_threshold(2.01)
    with pytest.raises(BadFrame):
        Cue.read(SENT | {"threshold": 2.01})
    for rule in CueRule:
        assert Cue.read(SENT | {"rule": rule.value}).rule is rule
    with pytest.raises(BadFrame, match="windows, streaks, steps"):
        Cue.read(SENT | {"rule": "dances"})


def test_plans_from_before_there_was_a_choice_follow_the_old_rules():
    data = make_plan().to_json()
    for name in ("cue_timing", "schedule", "adaptation"):
        del data[name]
    del data["goal"]["asks"]
    for phase in data["phases"]:
        for name in ("goal_percent", "robot", "rest_s"):
            del phase[name]
    plan = SessionPlan.from_json(data)
    assert plan.cue_timing == CueTiming()
    assert plan.schedule.answers_all
    assert plan.adaptation.mode == "off"
    assert plan.phases[0].robot
