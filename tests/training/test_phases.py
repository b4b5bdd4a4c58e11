"""Phases: their kinds, how they follow each other, what a pause does to them."""

from __future__ import annotations

import re

import pytest

from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import MAX_GAP_S
from rehab.training.measures import InvalidSetting
from rehab.training.phases import PHASE_KINDS, Phase, find_phase_kind, make_phase
from rehab.training.steps import Side
from tests.training.sessions import make_plan, start, step_at, walk


@pytest.mark.parametrize("slug", PHASE_KINDS)
def test_every_kind_makes_a_phase_with_its_defaults(slug: str) -> None:
    kind = find_phase_kind(slug)
    phase = make_phase(slug)
    assert kind.slug == phase.kind == slug
    assert (phase.name, phase.feedback) == (kind.label, kind.feedback)
    assert (phase.gain, phase.strides, phase.seconds) == (1.0, None, None)
    assert make_phase(slug, feedback=not kind.feedback).feedback is not kind.feedback
    assert 1 <= len(kind.calm_words.split()) <= 6
    assert not re.search("['’]", kind.calm_words)


def test_only_where_one_trains_is_there_feedback_by_default() -> None:
    assert {slug for slug, kind in PHASE_KINDS.items() if kind.feedback} == {
        "familiarization",
        "training",
    }


def test_an_unknown_kind_is_refused_with_the_known_ones() -> None:
    for make in (make_phase, lambda kind: Phase(kind, "Sprint", True)):
        with pytest.raises(InvalidSetting, match=r"'sprint'.*baseline, .*, retention"):
            make("sprint")


def test_a_phase_by_strides_counts_the_trained_leg_valid_or_not() -> None:
    fold = start(make_plan(make_phase("training", strides=3), make_phase("washout")))
    steps = walk(fold, [4.0, None])
    steps += walk(fold, [4.0, 4.0], side=Side.RIGHT)
    steps += walk(fold, [4.0, 4.0])
    assert [step.phase for step in steps] == [0, 0, 0, 0, 0, 1]
    assert (fold.phase_index, fold.phase.kind, fold.phase_strides) == (1, "washout", 1)


def test_a_phase_by_seconds_ends_with_the_step_that_reaches_them() -> None:
    fold = start(make_plan(make_phase("training", seconds=3), make_phase("washout")))
    steps = [step_at(fold, time_s) for time_s in (100.0, 101.0, 102.5, 103.5, 104.0)]
    assert [step.phase for step in steps] == [0, 0, 0, 0, 1]
    assert (fold.active_s, fold.phase_s) == (4.0, 0.5)


def test_the_wait_before_the_first_step_is_not_walked() -> None:
    fold = start(make_plan(make_phase("training", seconds=60)))
    step_at(fold, 5000.0)
    assert (fold.active_s, fold.phase_s) == (0.0, 0.0)


def test_whichever_limit_comes_first_ends_a_phase() -> None:
    phase = make_phase("training", strides=10, seconds=60)
    assert [phase.is_over(*lasted) for lasted in ((9, 59.9), (10, 0.0), (0, 60.0))] == [
        False,
        True,
        True,
    ]
    assert not make_phase("training").is_over(10**9, 1e9)


def test_a_pause_counts_neither_strides_nor_time() -> None:
    fold = start(make_plan(make_phase("training", strides=5), make_phase("washout")))
    walk(fold, [4.0, 4.0])
    fold.change(Change(ChangeKind.PAUSE))
    walk(fold, [4.0] * 20)
    assert (fold.phase_strides, fold.active_s, fold.phase_index) == (2, 1.0, 0)
    fold.change(Change(ChangeKind.RESUME))
    walk(fold, [4.0, 4.0])
    assert (fold.phase_strides, fold.active_s, fold.phase_s) == (4, 2.0, 2.0)
    walk(fold, [4.0])
    assert fold.phase_index == 1


def test_a_pause_without_steps_counts_no_time_either() -> None:
    fold = start(make_plan(make_phase("training", seconds=10), make_phase("washout")))
    step_at(fold, 0.0)
    fold.change(Change(ChangeKind.PAUSE))
    fold.change(Change(ChangeKind.RESUME))
    step_at(fold, 500.0)
    step_at(fold, 501.0)
    assert (fold.active_s, fold.phase_index) == (1.0, 0)


def test_a_paused_session_does_not_move_on() -> None:
    fold = start(make_plan(make_phase("training"), make_phase("washout", strides=1)))
    fold.change(Change(ChangeKind.PHASE, 1))
    fold.change(Change(ChangeKind.PAUSE))
    walk(fold, [4.0])
    assert not fold.completed


def test_after_the_last_phase_the_session_is_complete_and_still_scores() -> None:
    fold = start(make_plan(make_phase("training", strides=2)))
    completed = [walk(fold, [5.0]) and fold.completed for _ in range(3)]
    assert completed == [False, True, True]
    assert (fold.score, fold.phase_index) == (3, 0)


def test_each_phase_has_its_own_figures() -> None:
    fold = start(
        make_plan(
            make_phase("training", strides=2),
            make_phase("catch", strides=3),
            make_phase("training", strides=1),
        )
    )
    walk(fold, [5.0, 3.0, 5.0, 5.0, 3.0, 5.0])
    assert [tally.strides for tally in fold.phases] == [2, 3, 1]
    assert [tally.hits for tally in fold.phases] == [1, 2, 1]
    assert [tally.points for tally in fold.phases] == [0, 0, 1]
    assert fold.feedback.hit_rate == 2 / 3
    assert fold.tally_of("training").strides == 3
    assert fold.tally_of("baseline").strides == 0


def test_a_streak_survives_invalid_strides_and_phases_without_feedback() -> None:
    fold = start(
        make_plan(
            make_phase("training", strides=4),
            make_phase("catch", strides=1),
            make_phase("training"),
        )
    )
    walk(fold, [3.0, 5.0, None, 5.0])
    walk(fold, [3.0])
    walk(fold, [5.0])
    assert (fold.feedback.streak, fold.feedback.best_streak) == (3, 3)
    walk(fold, [3.0])
    assert (fold.feedback.streak, fold.feedback.best_streak) == (0, 3)


def test_the_pt_may_walk_a_phase_again() -> None:
    fold = start(make_plan(make_phase("training", strides=2, gain=0.9), make_phase("washout")))
    walk(fold, [5.0] * 3)
    fold.change(Change(ChangeKind.PHASE, 0))
    assert (fold.phase_strides, fold.phase_s, fold.gain) == (0, 0.0, 0.9)
    steps = walk(fold, [5.0] * 3)
    assert [step.phase for step in steps] == [0, 0, 1]
    assert [tally.strides for tally in fold.phases] == [4, 2]


def test_walking_the_last_phase_again_takes_completion_back() -> None:
    fold = start(make_plan(make_phase("training", strides=1)))
    walk(fold, [5.0])
    fold.change(Change(ChangeKind.PHASE, 0))
    assert not fold.completed


def test_the_pt_may_choose_the_first_phase_before_the_start() -> None:
    fold = start(make_plan(make_phase("training"), make_phase("catch", gain=1.1)))
    fold.change(Change(ChangeKind.PHASE, 1))
    (step,) = walk(fold, [4.0])
    assert (step.phase, step.gain, step.points) == (1, 1.1, None)


def test_a_gain_by_the_pt_lasts_until_the_next_phase() -> None:
    fold = start(
        make_plan(make_phase("training", strides=2, gain=0.85), make_phase("training", gain=0.9))
    )
    fold.change(Change(ChangeKind.GAIN, 1.2))
    assert [step.gain for step in walk(fold, [4.0] * 3)] == [1.2, 1.2, 0.9]


def test_a_long_gap_counts_as_ten_seconds_walked() -> None:
    fold = start(make_plan(make_phase("training", seconds=60), make_phase("washout")))
    step_at(fold, 0.0)
    step_at(fold, 600.0)  # a sensor that was silent for ten minutes, or a clock that jumped
    assert (fold.active_s, fold.phase_index) == (MAX_GAP_S, 0)
    step_at(fold, 605.2)  # a pause between recorded trials counts as it is
    assert fold.active_s == pytest.approx(15.2)
