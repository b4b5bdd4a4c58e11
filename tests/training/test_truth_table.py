"""What a step earns: docs/reference/scoring.md#truth-table, cell by cell."""

from __future__ import annotations

import copy
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.training.changes import Change, ChangeKind
from rehab.training.phases import make_phase
from rehab.training.scoring import RULES_VERSION
from rehab.training.steps import InvalidReason, Measurement, ScoredStep, Side
from rehab.training.summary.metrics import compute_metrics
from rehab.training.summary.summary import summarize_phases
from rehab.training.valences import VALENCES, CueGestures
from tests.training.sessions import make_plan, others_than, start, walk

GOAL = 4.0
HIT, MISS = 5.0, 3.0

# valence: (points of a hit, points of a miss)
EARNED: dict[str, tuple[int | None, int | None]] = {
    "positive": (1, 0),
    "negative": (0, -1),
    "binary": (1, -1),
    "explicit": (None, None),
}


@pytest.fixture(params=list(EARNED))
def valence(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def figures(step: ScoredStep) -> tuple[object, ...]:
    return step.shown, step.performance, step.hit, step.points


def test_the_table_covers_every_valence() -> None:
    assert set(EARNED) == set(VALENCES)


@pytest.mark.parametrize(
    ("value", "hit"),
    [(HIT, True), (GOAL, True), (math.nextafter(GOAL, 0), False), (MISS, False), (0.0, False)],
)
def test_a_judged_step(valence: str, value: float, hit: bool) -> None:
    fold = start(make_plan(valence=valence))
    (step,) = walk(fold, [value])
    points = EARNED[valence][0 if hit else 1]
    assert figures(step) == (value, value / GOAL, hit, points)
    assert (step.valid, step.reasons, step.goal, step.gain) == (True, (), GOAL, 1.0)
    assert step.rules_version == RULES_VERSION
    assert fold.score == points
    assert (fold.feedback.judged, fold.feedback.hits) == (1, int(hit))


WALKED = st.lists(st.sampled_from([HIT, HIT, MISS, MISS, MISS, None]), min_size=30, max_size=60)


@given(values=WALKED)
@pytest.mark.parametrize("valence", list(EARNED))
def test_points_follow_from_each_step_alone(valence: str, values: list[float | None]) -> None:
    """What a step earns does not depend on those before it; the score is their sum."""
    fold = start(make_plan(valence=valence))
    steps = walk(fold, values)
    of_hit, of_miss = EARNED[valence]
    assert [step.points for step in steps] == [
        None if value is None else of_hit if value >= GOAL else of_miss for value in values
    ]
    hits, misses = values.count(HIT), values.count(MISS)
    figures = compute_metrics(fold)
    assert figures.get("steps", 0) == hits + misses
    if of_hit is None or of_miss is None:
        assert (fold.score, "score" in figures) == (None, False)
        return
    assert fold.score == figures["score"] == of_hit * hits + of_miss * misses


@pytest.mark.parametrize(
    ("value", "flags", "reasons"),
    [
        (None, (), (InvalidReason.MISSING,)),
        (None, ("force_lost",), (InvalidReason.FORCE_LOST, InvalidReason.MISSING)),
        (math.nan, (), (InvalidReason.NOT_FINITE,)),
        (math.inf, (), (InvalidReason.NOT_FINITE,)),
        (-math.inf, (), (InvalidReason.NOT_FINITE,)),
        (math.nextafter(0, -1), (), (InvalidReason.OUT_OF_BOUNDS,)),
        (math.nextafter(20, 21), (), (InvalidReason.OUT_OF_BOUNDS,)),
        (1e308, (), (InvalidReason.OUT_OF_BOUNDS,)),
        (HIT, ("flagged",), (InvalidReason.FLAGGED,)),
        (MISS, ("unsteady", "flagged"), ("unsteady", InvalidReason.FLAGGED)),
    ],
)
def test_a_missing_or_invalid_step_is_a_gap(
    valence: str, value: float | None, flags: tuple[str, ...], reasons: tuple[str, ...]
) -> None:
    fold = start(make_plan(valence=valence))
    walk(fold, [HIT])
    score = fold.score
    (step,) = walk(fold, [value], reasons=flags)
    assert figures(step) == (None, None, None, None)
    assert (step.valid, step.reasons) == (False, reasons)
    assert fold.score == score
    assert (fold.feedback.strides, fold.feedback.valid, fold.feedback.judged) == (2, 1, 1)


@pytest.mark.parametrize("value", [HIT, MISS])
def test_a_step_while_paused_is_kept_and_never_scored(valence: str, value: float) -> None:
    fold = start(make_plan(valence=valence))
    fold.change(Change(ChangeKind.PAUSE))
    (step,) = walk(fold, [value])
    assert figures(step) == (None, None, None, None)
    assert (step.value, step.valid, step.reasons) == (value, False, (InvalidReason.PAUSED,))
    assert fold.score in (0, None)
    assert fold.trained.strides == 1
    assert fold.feedback.strides == fold.phases[0].strides == 0


@pytest.mark.parametrize("value", [HIT, MISS])
def test_a_step_without_feedback_is_judged_and_never_paid(valence: str, value: float) -> None:
    fold = start(make_plan(make_phase("catch"), valence=valence))
    (step,) = walk(fold, [value])
    assert figures(step) == (value, value / GOAL, value >= GOAL, None)
    assert step.valid
    assert fold.score in (0, None)
    assert fold.feedback.strides == 0
    assert fold.phases[0].hit_rate == (value >= GOAL)


@pytest.mark.parametrize("value", [HIT, MISS, None])
def test_a_step_of_the_other_leg_is_kept_and_never_scored(
    valence: str, value: float | None
) -> None:
    fold = start(make_plan(valence=valence))
    walk(fold, [HIT])
    before = copy.deepcopy((fold.trained, fold.feedback, fold.phases, fold.phase_strides))
    (step,) = walk(fold, [value], side=Side.RIGHT)
    assert figures(step) == (None, None, None, None)
    assert (step.value, step.valid) == (value, value is not None)
    assert (fold.trained, fold.feedback, fold.phases, fold.phase_strides) == before


def test_the_gain_changes_what_is_shown_and_so_what_is_earned(valence: str) -> None:
    fold = start(make_plan(make_phase("training", gain=0.85), valence=valence))
    nearly, enough = walk(fold, [4.70, 4.71])
    assert figures(nearly) == (0.85 * 4.70, 0.85 * 4.70 / GOAL, False, EARNED[valence][1])
    assert figures(enough) == (0.85 * 4.71, 0.85 * 4.71 / GOAL, True, EARNED[valence][0])


@pytest.mark.parametrize("later", list(EARNED))
def test_after_a_change_of_type_steps_earn_what_they_earn_in_that_one(
    valence: str, later: str
) -> None:
    phases = (make_phase("training"), make_phase("catch"), make_phase("training"))
    fold = start(make_plan(*phases, valence=valence, alternatives=others_than(valence)))
    fold.change(Change(ChangeKind.VALENCE, later))
    before = walk(fold, [HIT, MISS])
    fold.change(Change(ChangeKind.PHASE, 1))
    calm = walk(fold, [HIT, MISS])
    fold.change(Change(ChangeKind.PHASE, 2))
    after = walk(fold, [HIT, MISS])
    assert tuple(step.points for step in before) == EARNED[valence]
    assert tuple(step.points for step in calm) == (None, None)
    assert tuple(step.points for step in after) == EARNED[later]
    paid = [step.points for step in (*before, *after) if step.points is not None]
    assert fold.score == (sum(paid) if paid else None)
    assert fold.valences.changed_to == (() if later == valence else (later,))
    training = [phase for phase in summarize_phases(fold) if phase["feedback"]]
    assert [phase["valence"] for phase in training] == list(dict.fromkeys((valence, later)))
    if later == "explicit":
        assert fold.valence.cue == CueGestures()  # the robot stands still


@pytest.mark.parametrize("valence", list(EARNED))
@pytest.mark.parametrize("later", list(EARNED))
def test_a_type_changed_at_once_holds_from_the_next_step_of_the_same_phase(
    valence: str, later: str
) -> None:
    plan = make_plan(
        make_phase("training"),
        make_phase("training"),
        valence=valence,
        alternatives=others_than(valence),
    )
    fold = start(plan)
    before = walk(fold, [HIT, MISS])
    fold.change(Change(ChangeKind.VALENCE, later))  # which the other change makes needless
    fold.change(Change(ChangeKind.VALENCE_NOW, later))
    after = walk(fold, [HIT, MISS])
    assert tuple(step.points for step in before) == EARNED[valence]
    assert tuple(step.points for step in after) == EARNED[later]
    assert (fold.phase_index, fold.valences.next_slug) == (0, "")
    assert fold.valences.switches == ([] if later == valence else [(2, later)])
    walked = [phase for phase in summarize_phases(fold) if phase["strides"]]
    assert [(phase["valence"], phase["strides"]) for phase in walked] == (
        [(valence, 4)] if later == valence else [(valence, 2), (later, 2)]
    )


def test_a_type_counts_as_changed_to_only_once_a_step_may_have_come() -> None:
    plan = make_plan(
        make_phase("training"), valence="explicit", alternatives=others_than("explicit")
    )
    fold = start(plan)
    walk(fold, [HIT, MISS])
    fold.change(Change(ChangeKind.VALENCE_NOW, "binary"))
    assert list(fold.valences.changed_to) == ["binary"]
    fold.change(Change(ChangeKind.VALENCE_NOW, "explicit"))
    assert not fold.valences.changed_to
    assert not fold.valences.have_points
    walk(fold, [HIT])
    fold.change(Change(ChangeKind.VALENCE_NOW, "binary"))
    fold.change(Change(ChangeKind.VALENCE_NOW, "negative"))
    walk(fold, [HIT])
    fold.change(Change(ChangeKind.VALENCE_NOW, "explicit"))
    assert list(fold.valences.changed_to) == ["negative"]


def test_only_explicit_has_no_score(valence: str) -> None:
    fold = start(make_plan(valence=valence))
    assert fold.score == (None if valence == "explicit" else 0)


def test_a_value_that_is_not_finite_is_not_kept_but_one_out_of_bounds_is() -> None:
    fold = start(make_plan())
    assert [step.value for step in walk(fold, [math.nan, math.inf, -1.0])] == [None, None, -1.0]


def test_missing_and_invalid_are_counted_apart() -> None:
    fold = start(make_plan())
    walk(fold, [HIT, None, math.nan, None])
    walk(fold, [None], reasons=("force_lost",))
    tally = fold.trained
    assert (tally.strides, tally.valid, tally.invalid, tally.missing) == (5, 1, 2, 2)


def test_extra_values_are_kept() -> None:
    fold = start(make_plan())
    step = fold.step(Measurement(1, 0.0, Side.LEFT, HIT, extra={"speed_m_s": 0.99}))
    assert step.extra == {"speed_m_s": 0.99}
