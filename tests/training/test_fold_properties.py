"""What holds for every session: any plan, any steps, any changes."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from functools import partial

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rehab.training.changes import Change, ChangeKind, PauseReason
from rehab.training.feedback_bands import Band, Confetti, bands_to_json
from rehab.training.fold import SessionFold
from rehab.training.fold.checkpoints import fold_from_json, fold_to_json
from rehab.training.fold.tallies import STRIDES, Tally
from rehab.training.measures import InvalidSetting
from rehab.training.phases import PHASE_KINDS, make_phase
from rehab.training.plans import ChartStyle, SessionPlan
from rehab.training.steps import InvalidMeasurement, InvalidReason, Measurement, ScoredStep, Side
from rehab.training.summary.metrics import compute_metrics
from rehab.training.valences import VALENCES, Valence
from robot.wire.limits import PERFORMANCE_MAX
from tests.support.folds import fold_log
from tests.training.sessions import make_plan, others_than, start

Log = list[Measurement | Change]

ONE_BAND = (Band(0, "Go on."),)
TWO_BANDS = (Band(0, "Not yet."), Band(1, "There.", Confetti.MOST))

values = st.one_of(
    st.none(), st.floats(0, 20), st.floats(3, 5), st.sampled_from([math.nan, math.inf, -1.0, 4.0])
)
strides = st.tuples(
    st.one_of(st.floats(0, 3), st.sampled_from([-5.0, 0.1, 1.0])),  # seconds since the last one
    st.sampled_from([Side.LEFT, Side.LEFT, Side.LEFT, Side.RIGHT]),
    values,
    st.sampled_from([(), (), (), (), ("flagged",), ("missing",)]),
)
changes = st.builds(
    Change,
    st.sampled_from(
        [kind for kind in ChangeKind if kind not in (ChangeKind.FINISH, ChangeKind.ABORT)]
    ),
    st.one_of(
        st.none(),
        st.floats(0.5, 1.5),
        st.integers(-1, 3),
        st.floats(0, 15),
        st.just(math.nan),
        st.sampled_from([*VALENCES, *ChartStyle, *PauseReason]),
    ),
) | st.sampled_from([*VALENCES]).flatmap(
    lambda slug: st.sampled_from(
        [
            Change(ChangeKind.VALENCE, slug),
            Change(ChangeKind.VALENCE_NOW, slug),
            Change(ChangeKind.FEEDBACK_TEXT, {"valence": slug, "bands": bands_to_json(ONE_BAND)}),
            Change(
                ChangeKind.FEEDBACK_TEXT,
                {"valence": slug, "bands": bands_to_json(TWO_BANDS), "language": "es"},
            ),
        ]
    )
)
happenings = st.lists(st.one_of(strides, strides, strides, strides, changes), max_size=60)


@st.composite
def plans(draw: st.DrawFn) -> SessionPlan:
    phases = draw(
        st.lists(
            st.builds(
                make_phase,
                st.sampled_from(list(PHASE_KINDS)),
                gain=st.floats(0.5, 1.5),
                strides=st.none() | st.integers(1, 8),
                seconds=st.none() | st.floats(0.5, 8),
            ),
            min_size=1,
            max_size=4,
        )
    )
    valence = draw(st.sampled_from(list(VALENCES)))
    others = others_than(valence) if draw(st.integers(0, 3)) else ()  # none: a plan of before
    plan = partial(make_plan, valence=valence, alternatives=others)
    if draw(st.booleans()):
        return plan(make_phase("baseline", strides=50), *phases, percent=100)
    return plan(*phases, goal=draw(st.floats(0, 15, exclude_min=True)))


@st.composite
def sessions(draw: st.DrawFn) -> tuple[SessionPlan, Log]:
    """Return a plan and a log of it: what a session accepted of what happened."""
    plan = draw(plans())
    fold = start(plan)
    log: Log = [Change(ChangeKind.START)]
    if plan.goal.needs_baseline and draw(st.booleans()):
        log += [Measurement(n, float(n), Side.LEFT, 3.0 + n % 3) for n in range(1, 51)]
        fold = fold_log(plan, log)
    for happening in draw(happenings):
        if isinstance(happening, Change):
            try:
                fold.change(happening)
            except InvalidSetting:
                continue
            log.append(happening)
        else:
            elapsed_s, side, value, reasons = happening
            time_s = (fold.last_time_s or 0.0) + elapsed_s
            measurement = Measurement(fold.last_number + 1, time_s, side, value, reasons)
            fold.step(measurement)
            log.append(measurement)
    return plan, log


def walk_log(fold: SessionFold, log: Sequence[Measurement | Change]) -> list[ScoredStep]:
    steps = []
    for entry in log:
        if isinstance(entry, Change):
            fold.change(entry)
        else:
            steps.append(fold.step(entry))
    return steps


def tally(steps: Sequence[ScoredStep]) -> Tally:
    total = Tally()
    for step in steps:
        total.add(step)
    return total


@given(sessions(), st.integers(0, 120))
def test_the_log_gives_the_session_back_wherever_it_is_cut(
    session: tuple[SessionPlan, Log], cut: int
) -> None:
    plan, log = session
    whole = SessionFold(plan)
    steps = walk_log(whole, log)
    stored_plan = SessionPlan.from_json(json.loads(json.dumps(plan.to_json())))
    again = fold_log(stored_plan, log[:cut])
    assert walk_log(again, log[cut:]) == steps[count_steps(log[:cut]) :]
    assert vars(again) == vars(whole)


@given(sessions(), st.integers(0, 120))
def test_a_checkpoint_gives_the_fold_back_wherever_it_is_taken(
    session: tuple[SessionPlan, Log], cut: int
) -> None:
    plan, log = session
    whole, first = SessionFold(plan), SessionFold(plan)
    steps = walk_log(whole, log)
    walk_log(first, log[:cut])
    stored_plan = SessionPlan.from_json(json.loads(json.dumps(plan.to_json())))
    again = fold_from_json(stored_plan, json.loads(json.dumps(fold_to_json(first))))
    assert again is not None
    assert vars(again) == vars(first)
    assert walk_log(again, log[cut:]) == steps[count_steps(log[:cut]) :]
    assert vars(again) == vars(whole)
    assert fold_from_json(plan, fold_to_json(first) | {"version": 0}) is None


def count_steps(log: Log) -> int:
    return sum(isinstance(entry, Measurement) for entry in log)


@given(sessions())
def test_stored_steps_score_as_they_did(session: tuple[SessionPlan, Log]) -> None:
    """The database keeps scored steps; folding those again must alter none."""
    plan, log = session
    whole = SessionFold(plan)
    steps = iter(walk_log(whole, log))
    stored = [entry if isinstance(entry, Change) else measure_again(next(steps)) for entry in log]
    again = SessionFold(plan)
    assert walk_log(again, stored) == walk_log(SessionFold(plan), log)
    assert vars(again) == vars(whole)


def measure_again(step: ScoredStep) -> Measurement:
    return Measurement(step.number, step.time_s, step.side, step.value, step.reasons, step.extra)


@given(sessions())
def test_every_figure_follows_from_the_scored_steps(session: tuple[SessionPlan, Log]) -> None:
    plan, log = session
    fold = SessionFold(plan)
    steps = walk_log(fold, log)
    trained = [step for step in steps if step.side == plan.trained_side]
    walked = [step for step in trained if InvalidReason.PAUSED not in step.reasons]
    assert fold.trained == tally(trained)
    assert fold.feedback == tally([step for step in walked if plan.phases[step.phase].feedback])
    for index, phase in enumerate(fold.phases):
        assert phase == tally([step for step in walked if step.phase == index])
    if any(VALENCES[slug].has_points for slug in (plan.valence.slug, *fold.valences.changed_to)):
        assert fold.score == sum(step.points or 0 for step in steps)
    else:
        assert fold.score is None
        assert all(step.points is None for step in steps)
    for name in (*STRIDES, "judged", "hits", "close", "points"):
        for index, phase in enumerate(fold.phases):
            parts = [part for block, part in fold.blocks.items() if block.phase == index]
            assert sum(getattr(part, name) for part in parts) == getattr(phase, name)
    for total in (fold.trained, fold.feedback, *fold.phases):
        assert total.strides == total.valid + total.invalid + total.missing + total.late
        assert total.hits <= total.judged <= total.valid
        assert total.streak <= total.best_streak <= total.hits


@given(sessions())
def test_every_scored_step_keeps_its_promises(session: tuple[SessionPlan, Log]) -> None:
    plan, log = session
    fold = SessionFold(plan)
    steps = walk_log(fold, log)
    for step in steps:
        assert step.valid == (not step.reasons)
        assert len(set(step.reasons)) == len(step.reasons)
        judged = step.valid and step.side == plan.trained_side and step.goal is not None
        if judged:
            assert step.shown == step.gain * step.value
            assert step.hit == (step.shown >= step.goal) == (step.performance >= 1)
            assert abs(step.performance) <= PERFORMANCE_MAX
        else:
            assert (step.shown, step.performance, step.hit, step.points) == (None,) * 4
        valence = valence_at(fold, step)
        expected = None
        if judged and plan.phases[step.phase].feedback:
            expected = valence.points(step.hit)
        assert step.points == expected
        kept = (step.value, step.gain, step.shown, step.goal, step.performance)
        json.dumps(kept, allow_nan=False)


def valence_at(fold: SessionFold, step: ScoredStep) -> Valence:
    """Return the valence that was in force when a step came, by the switches alone."""
    slug = fold.plan.valence.slug
    for after, changed_to in fold.valences.switches:
        if step.number > after:
            slug = changed_to
    return VALENCES[slug]


@given(sessions())
def test_the_feedback_type_changes_by_hand_or_with_a_phase_of_feedback(
    session: tuple[SessionPlan, Log],
) -> None:
    plan, log = session
    fold = SessionFold(plan)
    for entry in log:
        before = (fold.valence.slug, fold.phase_index, len(fold.valences.switches))
        walk_log(fold, [entry])
        assert fold.valence == fold.valences.known[fold.valence.slug]
        if fold.valence.slug == before[0]:
            continue
        assert len(fold.valences.switches) == before[2] + 1
        if isinstance(entry, Change) and entry.kind is ChangeKind.VALENCE_NOW:
            assert fold.valence.slug == entry.value
            continue
        assert fold.phase.feedback
        assert fold.phase_strides == 0
        by_hand = isinstance(entry, Change) and entry.kind is ChangeKind.PHASE
        assert fold.phase_index != before[1] or by_hand
    assert fold.valences.next_slug != fold.valence.slug
    assert {fold.valence.slug, *fold.valences.changed_to} <= {
        plan.valence.slug,
        *fold.valences.known,
    }


@given(sessions())
def test_words_and_drawing_alter_no_score(session: tuple[SessionPlan, Log]) -> None:
    plan, log = session
    spoken = (ChangeKind.FEEDBACK_TEXT, ChangeKind.WORDS_SHOWN, ChangeKind.CHART_STYLE)
    quiet = [e for e in log if not (isinstance(e, Change) and e.kind in spoken)]
    one, other = SessionFold(plan), SessionFold(plan)
    assert walk_log(one, log) == walk_log(other, quiet)
    assert compute_metrics(one) == compute_metrics(other)


@given(sessions())
def test_every_figure_is_a_finite_number(session: tuple[SessionPlan, Log]) -> None:
    fold = fold_log(*session)
    assert all(math.isfinite(figure) for figure in compute_metrics(fold).values())
    assert 0 <= fold.phase_s <= fold.active_s < math.inf


@given(sessions(), strides)
def test_an_invalid_step_changes_nothing_but_counts(
    session: tuple[SessionPlan, Log], stride: tuple[float, Side, float | None, tuple[str, ...]]
) -> None:
    fold = fold_log(*session)
    before = copy.deepcopy(fold)
    elapsed_s, side, value, _ = stride
    time_s = (fold.last_time_s or 0.0) + elapsed_s
    step = fold.step(Measurement(fold.last_number + 1, time_s, side, value, ("flagged",)))
    assert not step.valid
    assert fold.score == before.score
    tallies = zip(
        (fold.trained, fold.feedback, *fold.phases),
        (before.trained, before.feedback, *before.phases),
        strict=True,
    )
    for now, then in tallies:
        counted = {"strides", "invalid", "missing"}
        assert figures_without(now, counted) == figures_without(then, counted)
        assert now.missing == then.missing
    if fold.phase_index == before.phase_index:
        assert (fold.goal, fold.gain) == (before.goal, before.gain)


def figures_without(total: Tally, names: set[str]) -> dict[str, float]:
    return {name: getattr(total, name) for name in Tally.__slots__ if name not in names}


@given(
    sessions(),
    st.builds(Change, st.sampled_from(list(ChangeKind)), st.none() | st.floats(width=64)),
)
def test_a_refused_change_leaves_the_session_as_it_was(
    session: tuple[SessionPlan, Log], change: Change
) -> None:
    fold = fold_log(*session)
    before = copy.deepcopy(vars(fold))
    changed = True
    try:
        fold.change(change)
    except InvalidSetting:
        changed = False
    if changed:
        assert (fold.trained, fold.feedback) == (before["trained"], before["feedback"])
    else:
        assert vars(fold) == before


@given(sessions(), st.sampled_from([-1, 0, 2, 100]))
def test_a_number_that_does_not_follow_leaves_the_session_as_it_was(
    session: tuple[SessionPlan, Log], offset: int
) -> None:
    fold = fold_log(*session)
    before = copy.deepcopy(vars(fold))
    number = max(1, fold.last_number + offset)
    assume(number != fold.last_number + 1)
    with pytest.raises(InvalidMeasurement, match=f"send {fold.last_number + 1}"):
        fold.step(Measurement(number, 1e6, Side.LEFT, 4.0))
    assert vars(fold) == before
