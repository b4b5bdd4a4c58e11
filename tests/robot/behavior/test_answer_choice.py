"""Answers from pools: varied, repeatable, and the ones that the walking asks for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bases import Abilities
from robot.behavior.answer_choice import APART, AnswerChooser, pick
from robot.behavior.cue import QUIET_PACE
from robot.behavior.window_decider import Decision
from robot.motion.gesture_variants import POOLS, VARIANTS, variants
from robot.wire.cue_limits import VARIED
from tests.support.robot_stage import CUE, WELCOME, FeelingBase, Stage

VARIED_CUE = CUE | {"above": VARIED, "below": VARIED}

means = st.lists(st.floats(0, 2), min_size=1, max_size=60)
seeds = st.integers(0, 2**40)
names = st.sampled_from([VARIED, *POOLS])


def decision(mean, threshold=0.9):
    return Decision(0.0, 5.0, 5.0, 5, mean, threshold, mean >= threshold)


def answers(seed, walked, name=VARIED):
    chooser, chosen = AnswerChooser(seed), []
    for mean in walked:
        chooser.observe(decision(mean))
        choice = chooser.choose(name, decision(mean), 1.0)
        chooser.mark_started(choice)
        chosen.append(choice)
    return chosen


@given(seeds, means, names)
def test_no_variant_comes_twice_within_four_and_a_seed_repeats_all(seed, walked, name):
    chosen = answers(seed, walked, name)
    played = [choice.gesture.name for choice in chosen]
    for start in range(len(played)):
        window = played[start : start + APART]
        assert len(set(window)) == len(window)
    assert chosen == answers(seed, walked, name)
    assert {choice.seed for choice in chosen} == {seed}


def test_the_first_answers_of_a_seed_are_the_same_for_ever():
    """They stand in the logs of studies: a new version of Python must not change them."""
    first = [pick(POOLS["joy"][:12], 7, number, ()).name for number in range(6)]
    assert first == ["joy_5", "joy_12", "joy_12", "joy_4", "joy_6", "joy_4"]


@pytest.mark.parametrize("pool", POOLS)
def test_each_variant_of_a_pool_has_its_turn(pool):
    seen = {choice.gesture.name for choice in answers(1, [1.0] * 300, pool)}
    assert seen == {gesture.name for gesture in POOLS[pool]}


@pytest.mark.parametrize(
    ("walked", "pools"),
    [
        ([1.0] * 5, "joy joy streak_3 joy streak_5"),
        (
            [1.0] * 10 + [0.2],
            "joy joy streak_3 joy streak_5 joy joy joy joy streak_10 disappointment",
        ),
        ([0.2, 0.2, 0.2, 1.0, 1.0], "disappointment disappointment disappointment comeback joy"),
        ([0.2, 0.85, 0.2, 0.5], "disappointment near_miss disappointment effort"),
        ([0.5, 1.0, 0.7], "disappointment joy disappointment"),
    ],
)
def test_the_pool_follows_from_the_walking(walked, pools):
    assert [choice.pool for choice in answers(3, walked)] == pools.split()


def session(number, times=17, **cue):
    """Return good and weak walking by turns, of ten minutes."""
    stage = Stage()
    stage.hear(**WELCOME | {"cue": VARIED_CUE | cue, "session": number})
    stage.walk(*([1.0, 1.2, 1.05, 0.95, 1.1] * 4 + [0.4, 0.8, 0.6, 0.85, 0.7] * 3) * times)
    return stage


def test_participants_of_a_study_see_the_same_answers():
    third, seventh, other = session(3, 2, seed=5001), session(7, 2, seed=5001), session(8, 2)
    assert third.of("decision") == seventh.of("decision")
    assert {one["seed"] for one in third.of("decision")} == {5001}
    names = [one["gesture"] for one in third.of("decision")]
    assert names != [one["gesture"] for one in other.of("decision")]


@pytest.mark.wide
def test_ten_minutes_repeat_nothing_within_four_and_repeat_exactly():
    stage = session(7)
    answered = [one for one in stage.of("decision") if one["gesture"]]
    assert len(answered) >= 100
    played = [one["gesture"] for one in answered]
    assert all(len(set(played[at : at + APART])) == APART for at in range(len(played) - APART + 1))
    assert len(set(played)) >= 25
    assert all(
        (one["seed"], one["gesture"].rpartition("_")[0]) == (7, one["pool"]) for one in answered
    )
    assert set(stage.ended) == {"done"}
    assert [one["gesture"] for one in session(7).of("decision")] == [
        one["gesture"] for one in stage.of("decision")
    ]
    assert played != [one["gesture"] for one in session(8).of("decision") if one["gesture"]]


@pytest.mark.parametrize("fixed", ["celebrate", "joy_3"])
def test_a_gesture_that_the_cue_names_wins_over_every_pool(fixed):
    stage = Stage()
    stage.hear(**WELCOME | {"cue": CUE | {"above": fixed}})
    stage.walk(*[1.0] * 26)
    decisions = stage.of("decision")
    assert [one["gesture"] for one in decisions] == [fixed] * len(decisions)
    assert not any("pool" in one or "seed" in one for one in decisions)


@pytest.mark.parametrize("intensity", [1.0, 0.5, 0.1])
@pytest.mark.parametrize("mean", [0.9, 1.2])
def test_every_varied_answer_is_as_large_as_is_seen(intensity, mean):
    stage = Stage()
    stage.hear(**WELCOME | {"cue": VARIED_CUE | {"intensity": intensity}})
    stage.walk(*[mean] * 21)
    for one in stage.of("decision"):
        assert one["intensity"] >= VARIANTS[one["gesture"]].least - 1e-3


@pytest.mark.parametrize("closed_loop", [True, False])
def test_face_and_voice_answer_as_strongly_as_the_robot_moves(closed_loop, monkeypatch):
    abilities = Abilities(simulated=True, moves=True, closed_loop=closed_loop)
    monkeypatch.setattr(FeelingBase, "abilities", abilities)
    stage = Stage(FeelingBase)
    stage.hear(**WELCOME | {"cue": VARIED_CUE | {"intensity": 0.8}})
    stage.walk(*[1.2] * 6)
    assert [one.strength for one in stage.base.answered] == [0.8 if closed_loop else 0.4]


@pytest.mark.parametrize(("intensity", "is_quiet"), [(1.0, False), (0.5, True)])
def test_a_quiet_robot_answers_by_what_is_short_enough_at_half_the_speed(intensity, is_quiet):
    stage = Stage()
    stage.hear(**WELCOME | {"cue": VARIED_CUE | {"above": "joy", "intensity": intensity}})
    stage.walk(*[1.0] * 60)
    played = {one["gesture"] for one in stage.of("decision") if one["gesture"]}
    assert (played <= {gesture.name for gesture in variants("joy", QUIET_PACE)}) is is_quiet


def test_off_answers_nothing():
    stage = Stage()
    stage.hear(**WELCOME | {"cue": VARIED_CUE | {"intensity": 0}})
    stage.walk(*[1.0] * 21)
    assert {one["reason"] for one in stage.of("decision")} == {"off"}
    assert not stage.of("gesture")
