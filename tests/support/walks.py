"""Whole sessions for tests of pages: walked here and now, from a list of values."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from rehab.people.models import Clinic, Patient
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.sources.synthetic import PROFILES, SyntheticWalker
from rehab.training.changes import Change, ChangeKind
from rehab.training.goals import GoalRule, Target
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Measurement, Side
from tests.support.world import NOW, store

HIT, MISS = 2.5, 1.5  # against the goal of 2 W/kg
GOAL = 2.0
LEFT, RIGHT = Side.LEFT, Side.RIGHT

# A stride's value, a change between strides, a stride with its side, or why a stride is invalid.
Walked = float | None | Change | tuple[Side, float] | str


def make_patient(clinic: Clinic, nickname: str = "Rosa", **fields: Any) -> Patient:
    """Create a patient whose left leg is paretic."""
    defaults: dict[str, Any] = {"code": f"K-{nickname}", "paretic_side": "left"}
    return Patient.everywhere.create(clinic=clinic, nickname=nickname, **defaults | fields)


def make_session(patient: Patient, valence: str = "positive", **settings: Any) -> TrainingSession:
    """Create a session that is ready to start; what is not set is usual.

    ``settings``: of its `SessionRequest`.
    """
    usual: dict[str, Any] = {
        "goal": GoalRule(value=GOAL),
        "trained_side": LEFT,
        "words_vary": False,
    }
    if "protocol" not in settings:
        usual["phases"] = (make_phase("training"),)
    return create_session(SessionRequest(patient=patient, valence=valence, **usual | settings))


def walk(
    patient: Patient,
    valence: str,
    walked: Sequence[Walked],
    *,
    end: ChangeKind | None = ChangeKind.FINISH,
    days_ago: int = 0,
    now: datetime = NOW,
    phases: tuple[Phase, ...] | None = None,
    simulated: bool = False,
    wanted: float | None = None,
) -> TrainingSession:
    """Create a session, walk it and end it. Strides follow each other by a second."""
    began = now - timedelta(days=days_ago)
    session = make_session(
        patient,
        valence,
        phases=phases or (make_phase("training"),),
        target=Target(hit_rate=wanted),
        simulated=simulated,
    )
    TrainingSession.everywhere.filter(pk=session.pk).update(created_at=began)
    session.created_at = began
    aggregate = SessionAggregate(session)
    rows = list(aggregate.change(Change(ChangeKind.START), None, began))
    for each in walked:
        at = began + timedelta(seconds=aggregate.fold.last_number)
        if isinstance(each, Change):
            rows += aggregate.change(each, None, at)
            continue
        reasons = (each,) if isinstance(each, str) else ()
        value = MISS if isinstance(each, str) else each
        side, value = value if isinstance(value, tuple) else (LEFT, value)
        number = aggregate.fold.last_number + 1
        step = Measurement(number, float(number), side, value, reasons)
        rows.append(aggregate.record_step(step, at))
    if end is not None:
        rows += aggregate.change(Change(end), None, at_end(began, aggregate))
    store(aggregate, rows)
    session.refresh_from_db()
    return session


def visit(
    patient: Patient, valence: str, seed: int, days_ago: int, count: int = 420, now: datetime = NOW
) -> TrainingSession:
    """Let a simulated patient walk a whole visit, with all phases, two goal changes and a pause."""
    paused_at, rest = 2 * count // 3, timedelta(seconds=30)
    began = now - timedelta(days=days_ago, seconds=1.1 * count + 2) - rest
    half = (count - 54 - 12 - 40) // 2
    session = make_session(
        patient,
        valence,
        goal=GoalRule(percent_of_baseline=97),
        phases=(
            make_phase("baseline", strides=54),
            make_phase("training", strides=half),
            make_phase("catch", strides=12),
            make_phase("training", "Training 85 %", gain=0.85, strides=half),
            make_phase("washout"),
        ),
        target=Target(hit_rate=0.6, duration_s=600),
    )
    TrainingSession.everywhere.filter(pk=session.pk).update(created_at=began)
    session.created_at = began
    walker = SyntheticWalker(PROFILES["good"], seed, LEFT)
    aggregate = SessionAggregate(session)
    rows = list(aggregate.change(Change(ChangeKind.START), None, began))
    for number in range(1, count + 1):
        at = began + timedelta(seconds=1.1 * number) + (number >= paused_at) * rest
        if number in {count // 2, 3 * count // 4}:
            goal = round(1.05 * (aggregate.fold.goal or GOAL), 2)
            rows += aggregate.change(Change(ChangeKind.GOAL, goal), None, at)
        if number == paused_at:
            rows += aggregate.change(Change(ChangeKind.PAUSE), None, at - rest)
            rows += aggregate.change(Change(ChangeKind.RESUME), None, at)
        rows.append(aggregate.record_step(walker.next_stride(aggregate.fold.phase), at))
    rows += aggregate.change(Change(ChangeKind.FINISH), None, now - timedelta(days=days_ago))
    store(aggregate, rows)
    session.refresh_from_db()
    return session


def at_end(began: datetime, aggregate: SessionAggregate) -> datetime:
    """Return the moment after the last stride."""
    return began + timedelta(seconds=aggregate.fold.last_number + 1)


def strides(hits: int, misses: int) -> list[Walked]:
    """Return so many hits and misses, in turn as long as both last."""
    both = [value for _ in range(min(hits, misses)) for value in (HIT, MISS)]
    return [*both, *[HIT] * (hits - misses), *[MISS] * (misses - hits)]
