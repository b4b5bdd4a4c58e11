"""Steps whose value is too uncertain for a verdict: told as close, in every type."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.training.closeness import COVERAGE, CloseSteps
from rehab.training.fold.checkpoints import fold_from_json, fold_to_json
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.plans import SessionPlan
from rehab.training.schedules import Schedule, ScheduleKind
from rehab.training.steps import Measurement, Side
from rehab.training.summary.summary import summarize_session
from rehab.training.valences import VALENCES
from tests.training.sessions import make_plan, start

GOAL = 4.0
CLOSE = CloseSteps(part=0.2)


def feed(fold, *pairs, version=None):
    """Walk values with their standard deviations."""
    steps = []
    for value, sd in pairs:
        number = fold.last_number + 1
        extra = {} if sd is None else {"a2_sd_w_kg": sd}
        steps.append(
            fold.step(
                Measurement(number, number, Side.LEFT, value, (), extra, rules_version=version)
            )
        )
    return steps


def test_a_part_of_the_interval_beyond_the_goal_makes_a_step_close():
    sd = 0.1
    half = COVERAGE * sd
    for part in (0.0, 0.1, 0.2, 0.4):
        edge = GOAL + half * (1 - 2 * part)
        rule = CloseSteps(part)
        assert rule.includes(edge - 1e-9, sd, GOAL)
        assert not rule.includes(edge + 1e-9, sd, GOAL)
        assert rule.includes(2 * GOAL - edge + 1e-9, sd, GOAL)
    assert not CloseSteps().includes(GOAL, sd, GOAL)
    assert not CLOSE.includes(GOAL, None, GOAL)
    assert not CLOSE.includes(GOAL, 0.0, GOAL)
    assert not CLOSE.includes(GOAL, float("nan"), GOAL)


@pytest.mark.parametrize("part", [-0.01, 0.5, 1.0, float("nan")])
def test_a_part_has_bounds(part):
    with pytest.raises(InvalidSetting, match="0 to 49"):
        CloseSteps(part)


@pytest.mark.parametrize("valence", VALENCES)
def test_a_close_step_pays_and_takes_nothing_and_is_counted_apart(valence):
    fold = start(make_plan(valence=valence, close_steps=CLOSE))
    plain = start(make_plan(valence=valence))
    pairs = [(4.5, 0.01), (4.01, 0.1), (3.99, 0.1), (4.6, 0.01), (3.0, 0.01), (3.95, None)]
    close, usual = feed(fold, *pairs), feed(plain, *pairs)

    assert [step.close for step in close] == [False, True, True, False, False, False]
    assert not any(step.close for step in usual)
    for step, other in zip(close, usual, strict=True):
        # What was measured stays.
        assert (step.value, step.shown, step.performance, step.hit) == (
            *(other.value, other.shown, other.performance, other.hit),
        )
        none = None if not VALENCES[valence].has_points else 0
        assert step.points == (none if step.close else other.points)
    tally = fold.feedback
    assert (tally.judged, tally.hits, tally.close, tally.streak) == (6, 2, 2, 0)
    assert tally.best_streak == 2  # neither broken nor longer by the close ones
    assert tally.hit_rate == 2 / 4
    assert plain.feedback.hits == 3
    figures = summarize_session(fold)
    assert (figures["hits"], figures["close"], figures["phases"][0]["close"]) == (2, 2, 2)


def test_the_gain_of_a_phase_is_that_of_its_uncertainty_too():
    fold = start(make_plan(make_phase("training", gain=0.8), close_steps=CLOSE))
    edge = (GOAL + COVERAGE * 0.8 * 0.1 * (1 - 2 * 0.2)) / 0.8
    assert [step.close for step in feed(fold, (edge - 1e-6, 0.1), (edge + 1e-6, 0.1))] == [
        True,
        False,
    ]


def test_other_measures_have_no_uncertainty():
    """The standard deviation is that of A2, and says nothing of another quantity."""
    own = replace(A2, slug="own", channel="")
    fold = start(make_plan(measure=own, close_steps=CLOSE))
    assert not feed(fold, (GOAL, 0.5))[0].close


@pytest.mark.parametrize(("version", "close"), [(1, False), (2, False), (3, True), (None, True)])
def test_older_rules_know_no_close_steps(version, close):
    fold = start(make_plan(close_steps=CLOSE))
    (step,) = feed(fold, (4.01, 0.1), version=version)
    assert (step.close, step.points) == (close, 0 if close else 1)


def test_plans_keep_the_choice_and_those_from_before_have_none():
    plan = make_plan(close_steps=CloseSteps(0.1, "Ungefähr am Ziel."))
    stored = json.loads(json.dumps(plan.to_json()))
    assert SessionPlan.from_json(stored) == plan
    del stored["close_steps"]
    assert SessionPlan.from_json(stored).close_steps == CloseSteps()


def test_a_summary_tells_close_steps_apart():
    schedule = Schedule(ScheduleKind.SUMMARY, 4)
    fold = start(make_plan(schedule=schedule, close_steps=CLOSE))
    feed(fold, (4.5, 0.01), (4.01, 0.1), (3.0, 0.01), (3.99, 0.1))
    answer = fold.delivery.answer
    assert (answer.steps, answer.hits, answer.close) == (4, 1, 2)
    assert answer.points == fold.feedback.points == 0  # one paid, one taken


VALUES = st.lists(st.tuples(st.floats(3.0, 5.0), st.sampled_from([None, 0.01, 0.1, 0.5])))


@given(pairs=VALUES, part=st.floats(0, 0.49), cut=st.integers(0, 40))
def test_sums_hold_and_a_checkpoint_goes_on_as_the_log_does(pairs, part, cut):
    plan = make_plan(close_steps=CloseSteps(part))
    fold = start(plan)
    steps = feed(fold, *pairs[:cut])
    later = fold_from_json(plan, json.loads(json.dumps(fold_to_json(fold))))
    rest = feed(fold, *pairs[cut:])
    assert feed(later, *pairs[cut:]) == rest
    assert later.feedback == fold.feedback
    tally, steps = fold.feedback, steps + rest
    assert tally.judged == len(steps)
    assert tally.close == sum(step.close for step in steps)
    assert tally.hits == sum(step.hit and not step.close for step in steps)
    assert tally.points == sum(step.points for step in steps)
