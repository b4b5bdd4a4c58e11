"""Goals that follow the patient: the suggestion, and the staircase."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.sources.synthetic import PROFILES, SyntheticWalker
from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.goal_adaptation import (
    DEFAULT_HIT_RATE,
    SUGGESTION_STRIDES,
    AdaptationMode,
    GoalAdaptation,
    Staircase,
    suggest_goal,
)
from rehab.training.goals import Target
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import make_phase
from tests.training.sessions import SWAY, make_plan, start, walk

AUTOMATIC = GoalAdaptation(AdaptationMode.AUTOMATIC)
VALUES = st.lists(
    st.floats(0.5, 14, allow_nan=False), min_size=SUGGESTION_STRIDES, max_size=40, unique=True
)


@pytest.mark.parametrize("measure", [A2, SWAY])
@given(values=VALUES, rate=st.floats(0.05, 1))
def test_a_suggested_goal_gives_the_wanted_share_of_hits(measure, values, rate):
    goal = suggest_goal(measure, values, rate)

    latest = values[-SUGGESTION_STRIDES:]
    hits = sum(one >= goal if measure.higher_is_better else one <= goal for one in latest)
    wanted = max(1, int(SUGGESTION_STRIDES * rate + 0.5))
    # Two values may be so near to each other that nothing lies between them.
    assert abs(hits - wanted) <= 1


def test_fewer_than_twenty_strides_and_impossible_goals_suggest_nothing():
    assert suggest_goal(A2, [4.0] * (SUGGESTION_STRIDES - 1), 0.6) is None
    assert suggest_goal(A2, [0.0] * SUGGESTION_STRIDES, 0.6) is None
    assert suggest_goal(A2, [4.0] * SUGGESTION_STRIDES, 0.6) == 4.0


@pytest.mark.parametrize(
    ("rate", "goal"), [(0.62, 2.125), (0.63, 1.875), (1, 0.25)]
)  # 12.4 … of 20
def test_the_wanted_share_is_rounded_to_the_nearest_number_of_hits(rate, goal):
    assert suggest_goal(A2, [stride / 4 for stride in range(1, 21)], rate) == goal


def test_a_session_suggests_from_valid_training_strides_as_they_are_shown():
    plan = make_plan(
        make_phase("training", strides=20, gain=0.5), make_phase("catch"), target=Target(0.6)
    )
    fold = start(plan)
    walk(fold, [None, *[4.0] * 18], reasons=())
    assert fold.suggested_goal is None
    walk(fold, [4.0])
    assert fold.phase.kind == "catch"
    assert fold.suggested_goal is None  # nothing is to follow there
    fold.change(Change(ChangeKind.PHASE, 0))
    assert fold.suggested_goal is None  # the stride without a value does not count
    walk(fold, [4.0])
    assert fold.suggested_goal == 2.0
    fold.change(Change(ChangeKind.GOAL_ADAPTATION, "off"))
    assert fold.suggested_goal is None


@pytest.mark.parametrize(
    ("wanted", "hits", "factor"),
    [
        *((0.6, hits, None) for hits in (14, 12, 10)),
        *((0.6, hits, factor) for hits, factor in ((20, 1.04), (16, 1.02), (4, 0.96))),
        # In binary figures 16/20 − 0.7 is a hair more than the tolerance of 0.1.
        (DEFAULT_HIT_RATE, 16, None),
        (DEFAULT_HIT_RATE, 12, None),
        (DEFAULT_HIT_RATE, 17, 1.015),
        (DEFAULT_HIT_RATE, 11, 0.985),
    ],
)
def test_a_block_moves_the_goal_by_its_weighted_steps(wanted, hits, factor):
    staircase = Staircase()
    moved = [
        staircase.add(AUTOMATIC, A2, wanted, goal=4.0, gain=1.0, hit=number < hits)
        for number in range(20)
    ]
    assert moved[:-1] == [None] * 19
    assert moved[-1] == (None if factor is None else pytest.approx(4.0 * factor))


def test_another_gain_begins_a_new_block():
    staircase = Staircase()
    gains = [1.0] * 19 + [0.9] * 20
    moved = [
        staircase.add(AUTOMATIC, A2, 0.6, goal=4.0, gain=gain, hit=gain != 1) for gain in gains
    ]
    # Nineteen misses before are no part of the block of twenty hits.
    assert moved == [None] * 38 + [pytest.approx(4.16)]


def test_where_lower_is_better_hits_lower_the_goal():
    staircase = Staircase()
    goals = [staircase.add(AUTOMATIC, SWAY, 0.6, goal=10.0, gain=1.0, hit=True) for _ in range(20)]
    assert goals[-1] == pytest.approx(10 / 1.04)


@pytest.mark.parametrize(("value", "end"), [(9.0, 4.8), (1.0, 3.2)])
def test_goals_stay_within_a_fifth_of_what_the_therapist_set(value, end):
    fold = start(make_plan(adaptation=AUTOMATIC, target=Target(0.6)))
    walk(fold, [value] * 400)
    assert fold.goal == pytest.approx(end)
    fold.change(Change(ChangeKind.GOAL, 3.0))  # the new anchor
    walk(fold, [value] * 400)
    assert fold.goal == pytest.approx(3.0 * end / 4.0)


@pytest.mark.parametrize("kind", ["catch", "washout", "baseline", "retention", "familiarization"])
def test_goals_follow_in_training_only(kind):
    phase = make_phase(kind, feedback=True)
    fold = start(make_plan(phase, adaptation=AUTOMATIC, target=Target(0.6)))
    walk(fold, [9.0] * 100)
    assert fold.goal == 4.0


def test_a_therapist_freezes_the_goal_and_lets_it_go_on():
    fold = start(make_plan(adaptation=AUTOMATIC, target=Target(0.6)))
    walk(fold, [9.0] * 20)
    moved = fold.goal
    assert moved == pytest.approx(4.16)
    fold.change(Change(ChangeKind.GOAL_ADAPTATION, "suggest"))
    walk(fold, [9.0] * 60)
    assert fold.goal == moved
    fold.change(Change(ChangeKind.GOAL_ADAPTATION, "automatic"))
    walk(fold, [9.0] * 20)
    assert fold.goal > moved


@pytest.mark.parametrize("wanted", [0.2, 0.95, 1.0])
def test_a_share_of_hits_that_no_staircase_keeps_is_refused(wanted):
    with pytest.raises(InvalidSetting, match="30 to 90 %"):
        make_plan(adaptation=AUTOMATIC, target=Target(wanted))
    fold = start(make_plan(target=Target(wanted)))
    with pytest.raises(InvalidSetting, match="30 to 90 %"):
        fold.change(Change(ChangeKind.GOAL_ADAPTATION, "automatic"))
    assert fold.adaptation_mode is AdaptationMode.SUGGEST


def walk_towards(
    profile: str, seed: int, start_at: float, limit: float, strides: int = 1500
) -> tuple[float, SessionFold]:
    """Return the late hit rate and the fold of a simulated patient who answers each goal."""
    walker = SyntheticWalker(PROFILES[profile], seed)
    plan = make_plan(
        make_phase("training"),
        goal=start_at * PROFILES[profile].baseline_w_kg,
        adaptation=GoalAdaptation(AdaptationMode.AUTOMATIC, limit=limit),
        target=Target(0.6),
    )
    fold = start(plan)
    early = (0, 0)
    for number in range(strides):
        if number == strides * 3 // 5:
            early = fold.feedback.hits, fold.feedback.judged
        walker.goal_w_kg = fold.goal
        fold.step(walker.next_stride(fold.phase))
    hits, judged = fold.feedback.hits, fold.feedback.judged
    return (hits - early[0]) / (judged - early[1]), fold


# The first goal by the baseline, of which "good" learns up to 1.7; and how many strides are walked:
# after ten minutes the one who tires faster than the pauses make good can walk to no goal at all.
@pytest.mark.parametrize(
    ("profile", "first", "strides"), [("good", 1.3, 1500), ("poor", 1, 1500), ("fatiguing", 1, 600)]
)
def test_patients_who_learn_and_tire_are_kept_in_the_band(profile, first, strides):
    walked = [walk_towards(profile, seed, first, 0.5, strides) for seed in range(3)]
    rates = [rate for rate, _fold in walked]
    shares = [fold.goal / PROFILES[profile].baseline_w_kg / first for _rate, fold in walked]
    # Within the band and its sampling error; and nowhere near the bounds: nothing ran away.
    assert 0.48 < sum(rates) / len(rates) < 0.72, (rates, shares)
    assert all(0.55 < share < 1.45 for share in shares), (rates, shares)


def test_who_learns_beyond_the_bounds_stays_at_them():
    _rate, fold = walk_towards("good", 1, 1.0, 0.2)
    assert fold.goal == pytest.approx(1.2 * PROFILES["good"].baseline_w_kg)


def test_without_it_the_same_patients_leave_the_band():
    """What the staircase is for: with a fixed goal, one hits nearly always."""
    walker = SyntheticWalker(PROFILES["good"], 1)
    fold = start(make_plan(goal=PROFILES["good"].baseline_w_kg, target=Target(0.6)))
    for _ in range(1500):
        walker.goal_w_kg = fold.goal
        fold.step(walker.next_stride(fold.phase))
    assert fold.feedback.hit_rate > 0.75


def test_a_walk_without_skill_does_not_run_away():
    """Someone whose strides ignore the goal: the goal settles at their own quantile."""
    draw = random.Random(5)
    fold = start(make_plan(adaptation=AUTOMATIC, target=Target(0.6), goal=3.6))
    goals = []
    for _ in range(1500):
        walk(fold, [draw.gauss(4.0, 0.4)])
        goals.append(fold.goal)
    # 60 % of N(4, 0.4) lie above 4 − 0.2533 × 0.4.
    assert sum(goals[500:]) / 1000 == pytest.approx(3.9, abs=0.12)
    assert max(goals) - min(goals) < 0.7
