"""The tables of steps, and of the feedback that the patient's page showed for each."""

from __future__ import annotations

from collections.abc import Iterator
from operator import methodcaller
from typing import Any, NamedTuple

from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.exports.column_definitions import Column, Table, Type
from rehab.exports.selection import Selection
from rehab.sessions.events.step import StepContext, patient_step
from rehab.sessions.log import Step
from rehab.sessions.log_fold import DamagedLog, fold_log, log_entries
from rehab.sessions.models import TrainingSession
from rehab.sessions.state_messages import Message
from rehab.sessions.step_columns import MEASURE_UNIT, STEP_COLUMNS, StepColumn
from rehab.training.changes import Change
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase
from rehab.training.steps import InvalidMeasurement, Measurement

TYPES: dict[Any, Type] = {
    models.PositiveIntegerField: Type.INTEGER,
    models.PositiveSmallIntegerField: Type.INTEGER,
    models.SmallIntegerField: Type.INTEGER,
    models.FloatField: Type.NUMBER,
    models.BooleanField: Type.BOOLEAN,
    models.DateTimeField: Type.TIME,
    models.CharField: Type.TEXT,
    models.JSONField: Type.JSON,
}


class StepRow(NamedTuple):
    """A step with what holds for it: ``step`` has the fields of `STEP_COLUMNS`."""

    step: Any
    trained: bool
    phase: Phase
    feedback_type: str


def read_steps(selection: Selection, session: TrainingSession) -> Iterator[StepRow]:
    """Yield the steps of a session."""
    plan = session.to_plan()
    switches = _valence_switches(session)
    fields = [column.field for column in STEP_COLUMNS]
    for step in selection.read_pages(Step, session, fields, "number"):
        phase = plan.phases[step.phase]
        in_force = next(slug for after, slug in switches if after < step.number)
        trained = step.side == session.trained_side
        yield StepRow(step, trained, phase, in_force if phase.feedback else "")


def _valence_switches(session: TrainingSession) -> list[tuple[int, str]]:
    """Return the valences in force, the last one first, each with the step that it came after."""
    if not session.changed_to:
        return [(-1, session.valence)]
    switches = fold_log(SessionFold(session.to_plan()), session).valences.switches
    return [*reversed(switches), (-1, session.valence)]


def _stored(column: StepColumn) -> Column:
    """Return the column of a step's field."""
    kind, source = TYPES[type(Step._meta.get_field(column.field))], f"step.{column.field}"
    name, more = column.exported_as or column.field, (column.unit, column.is_channel)
    if column.field == "reasons":
        return Column(name, column.meaning, lambda row: " ".join(row.step.reasons), unit="")
    if column.field == "extra":
        return Column(name, column.meaning, lambda row: row.step.extra or None, kind)
    return Column(name, column.meaning, source, kind, *more)


STEPS = Table(
    "steps.csv",
    _("a row for each step"),
    read_steps,
    (
        *map(_stored, STEP_COLUMNS),
        Column(
            "trained",
            "true: a step of the trained leg; the others are never scored.",
            "trained",
            Type.BOOLEAN,
            is_channel=True,
        ),
        Column(
            "phase_kind",
            "baseline, familiarization, training, catch, washout, retention.",
            "phase.kind",
        ),
        Column("phase_name", "Name of the phase.", "phase.name"),
        Column.flag("feedback", "true: the patient got feedback in this phase.", "phase.feedback"),
        Column(
            "feedback_type",
            "The type in force; empty in a phase without feedback.",
            "feedback_type",
        ),
    ),
)


def read_feedback(_selection: Selection, session: TrainingSession) -> Iterator[Message]:
    """Yield the message of the patient's page for each step that had one.

    The same fold and the same rule make them as made the page's. A step that arrived too late to
    be shown at its moment is among them, as its points counted; the table of steps says which.
    """
    fold = SessionFold(session.to_plan())
    try:
        for entry in log_entries(session):
            try:
                message = _fold(fold, entry)
            except (InvalidSetting, InvalidMeasurement):  # it had no effect when it was stored
                continue
            if message is not None and message["kind"] in {"step", "missing"}:
                yield message
    except DamagedLog:  # `fold_log` has logged it; what was shown behind a hole is unknown
        return


def _fold(fold: SessionFold, entry: Measurement | Change) -> Message | None:
    if isinstance(entry, Change):
        fold.change(entry)
        return None
    context, step = StepContext.of(fold), fold.step(entry)
    score, streak, answer = fold.score, fold.feedback.streak, fold.delivery.answer
    return patient_step(fold.plan, context, step, score, streak, live=True, answer=answer)


def _shown(
    name: str, meaning: str, kind: Type = Type.TEXT, unit: str = "", key: str = ""
) -> Column:
    """Return a column of what a message says by the same name, or by ``key``."""
    return Column(name, meaning, methodcaller("get", key or name), kind, unit)


FEEDBACK = Table(
    "feedback.csv",
    _("what the page said and showed after each step"),
    read_feedback,
    (
        _shown("number", "Number of the step.", Type.INTEGER),
        _shown("kind", "step, or missing: the page said that it had no value."),
        _shown("words", "What the page said, in the patient's language; empty: nothing."),
        _shown("confetti", "none, little, much or most; a calm page shows none."),
        _shown("emblem", "The sign that the page drew."),
        _shown("points", "Points that the page showed.", Type.INTEGER, "points"),
        _shown("score", "The sum that the page showed.", Type.INTEGER, "points"),
        _shown("streak", "The row of hits that the page showed.", Type.INTEGER, "steps"),
        _shown(
            "value_shown", "The value as a number, if shown.", Type.NUMBER, MEASURE_UNIT, "shown"
        ),
        Column.integer(
            "summary_steps",
            "Of how many steps it was the summary.",
            lambda message: message.get("summary", {}).get("steps"),
            "steps",
        ),
    ),
)
