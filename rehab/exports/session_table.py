"""The table of sessions."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date
from functools import cached_property
from typing import Any

from django.utils.translation import gettext_lazy as _

from rehab.exports.column_definitions import Column, Table, Type
from rehab.exports.selection import Selection
from rehab.people.field_policy import Covariate, covariates
from rehab.people.models import Patient
from rehab.sessions.log import Remark
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import summarize_conditions
from rehab.sessions.setup.option import AS_IS, Group, Option, OptionColumn
from rehab.sessions.setup.options import exported_options
from rehab.sessions.step_columns import MEASURE_UNIT
from rehab.training.plans import SessionPlan
from rehab.training.summary.metrics import METRICS


class SessionRow:
    """A session with its plan and metrics. ``source`` is empty where it may name a person."""

    def __init__(self, session: TrainingSession, source: str) -> None:
        self.session, self.source = session, source
        self.plan: SessionPlan = session.to_plan()
        self.patient: Patient = session.patient
        self.day: date = session.began_at.date()

    @cached_property
    def conditions(self) -> dict[str, float]:
        """How the patient walked, by the kinds of remarks (`summarize_conditions`)."""
        noted: Any = getattr(self.session, "walked_under", None)  # `Selection` reads them at once
        events = self.session.events.order_by("pk") if noted is None else noted
        return summarize_conditions(self.session, events)

    @cached_property
    def metrics(self) -> dict[str, float]:
        """Its figures, by their slugs."""
        rows: Any = self.session.metrics.all()
        return {row.slug: row.value for row in rows}


def read_sessions(selection: Selection, session: TrainingSession) -> Iterator[SessionRow]:
    """Yield the row of a session."""
    yield SessionRow(session, session.source if selection.named else "")


def _metric_column(slug: str, label: str, unit: str) -> Column:
    return Column.number(slug, unit, f"{label} of the session.", lambda row: row.metrics.get(slug))


def _condition_column(name: str, kind: Remark, unit: str, meaning: str) -> Column:
    return Column.number(name, unit, meaning, lambda row: row.conditions.get(kind))


def _option_column(option: Option, column: OptionColumn) -> Column:
    """Return the column of a set-up option, in the unit of the plan."""
    types = {bool: Type.BOOLEAN, int: Type.INTEGER, float: Type.NUMBER}
    # Units of the plan are ratios and seconds, also where people give whole numbers.
    kind = types.get(option.kind, Type.TEXT) if option.conversion is AS_IS else Type.NUMBER
    return Column(
        column.name,
        column.meaning,
        lambda row: option.get(row.plan, row.session.walking),
        kind,
        column.unit,
    )


def _covariate_column(field: str, covariate: Covariate) -> Column:
    """Return the column that is made from a field of the patient."""
    return Column(
        covariate.name,
        covariate.meaning,
        lambda row: covariate.value(getattr(row.patient, field), row.day),
        Type(covariate.type),
        covariate.unit,
    )


SETUP = tuple(_option_column(option, column) for option, column in exported_options())
# What analyses adjust by, in bands: no date of birth or of the stroke.
PARTICIPANT = tuple(_covariate_column(*each) for each in covariates(Patient).items())
# Conditions that are numbers: FHIR has them as observations.
CONDITIONS = tuple(
    column
    for column, (option, _column) in zip(SETUP, exported_options(), strict=True)
    if option.group is Group.WALKING and column.type is Type.NUMBER
)
# How the patient walked, weighted by the steps that each condition held for.
WALKED = tuple(
    _condition_column(name, kind, unit, meaning)
    for name, kind, unit, meaning in (
        ("mean_belt_speed", Remark.BELT_SPEED, "m/s", "Mean speed of the belt over the steps."),
        ("mean_weight_support", Remark.WEIGHT_SUPPORT, "%", "Mean support over the steps."),
        ("walking_aid", Remark.WALKING_AID, "ratio", "Share of the steps with a walking aid."),
        ("orthosis", Remark.ORTHOSIS, "ratio", "Share of the steps with an orthosis."),
        ("handrail", Remark.HANDRAIL, "ratio", "Share of the steps at the handrail."),
        ("helping_hand", Remark.HELPING_HAND, "ratio", "Share with a therapist's hand."),
        ("highest_exertion", Remark.BORG, "0 to 10", "Highest exertion noted, Borg CR10."),
        ("highest_pain", Remark.PAIN, "0 to 10", "Highest pain noted, numeric rating scale."),
    )
)
FIGURES = tuple(_metric_column(m.slug, m.label, m.unit or "ratio") for m in METRICS.values())

SESSIONS = Table(
    "sessions.csv",
    _("a row for each session"),
    read_sessions,
    (
        Column.time("created_at", "When it was set up.", "session.created_at"),
        Column.time("started_at", "When the patient began to walk.", "session.started_at"),
        Column.time("ended_at", "When it ended.", "session.ended_at"),
        Column(
            "state", "ready, running, paused, finished or aborted (ended early).", "session.state"
        ),
        Column(
            "feedback_type",
            "positive, negative, binary or explicit, as it began.",
            "session.valence",
        ),
        Column(
            "changed_to",
            "Feedback types it was changed to, with commas between.",
            "session.changed_to",
        ),
        Column.flag(
            "excluded",
            "true: a therapist left it out of figures (corrections.csv).",
            "session.excluded",
        ),
        Column("measure", "What was trained; a2 is ankle push-off power.", "session.measure.slug"),
        Column("unit", "Unit of values and goals of this session.", "session.measure.unit"),
        Column("trained_side", "The leg whose steps count.", "session.trained_side"),
        Column.number("goal", MEASURE_UNIT, "Goal in force at the end.", "session.goal"),
        Column.number("walked", "s", "Time of walking, without pauses.", "session.active_s"),
        Column(
            "late_strides",
            "Strides of the trained leg that do not count as their samples came late from the lab.",
            "session.late_strides",
            Type.INTEGER,
        ),
        Column(
            "protocol",
            "Name of the list of phases it was built from.",
            lambda row: row.session.protocol and row.session.protocol.name,
        ),
        *SETUP,
        *WALKED,
        Column.number(
            "close_part",
            "ratio",
            "Part of a value's 95 % interval beyond the goal that makes a step close; empty: none.",
            "plan.close_steps.part",
        ),
        Column.flag("simulated", "true: no person walked.", "session.simulated"),
        Column.flag(
            "imported",
            "true: from the original GARRY, which stored no steps.",
            lambda row: row.session.legacy_id is not None,
        ),
        Column("source", "Where its steps came from; empty for researchers.", "source"),
        *PARTICIPANT,
        *FIGURES,
    ),
)
