"""What the patient's page was told of each step, from the log: words, confetti, points, sums."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rehab.sessions.events.step import StepContext, patient_step
from rehab.sessions.models import TrainingSession
from rehab.sessions.replay import DamagedLog, log_entries
from rehab.training.changes import Change
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.steps import InvalidMeasurement

TOLD = {"step", "missing"}  # kinds of a message that answers a step with anything


def told_steps(session: TrainingSession) -> Iterator[tuple[Any, ...]]:
    """Yield a row for each step that the page answered: the columns of ``FEEDBACK`` from number on.

    The same fold and the same rule make them as made the page's. A step that arrived too late to
    be answered at its moment is among them, as its points counted; the steps' table says which.
    """
    fold = SessionFold(session.to_plan())
    try:
        for entry in log_entries(session):
            try:
                told = _fold(fold, entry)
            except (InvalidSetting, InvalidMeasurement):  # it had no effect when it was stored
                continue
            if told is not None:
                yield told
    except DamagedLog:  # `fold_log` has told it; nobody knows what was shown behind a hole
        return


def _fold(fold: SessionFold, entry: Any) -> tuple[Any, ...] | None:
    if isinstance(entry, Change):
        fold.change(entry)
        return None
    context = StepContext.of(fold)
    step = fold.step(entry)
    told = patient_step(
        fold.plan,
        context,
        step,
        fold.score,
        fold.feedback.streak,
        live=True,
        answer=fold.telling.answer,
    )
    if told is None or told["kind"] not in TOLD:
        return None
    summary = told.get("summary") or {}
    names = ("number", "kind", "words", "confetti", "emblem", "points", "score", "streak", "shown")
    return (*(told.get(name) for name in names), summary.get("steps"))
