"""The table of sessions."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date
from functools import cached_property
from typing import Any

from django.utils.translation import gettext_lazy as _

from rehab.exports.selection import Selection
from rehab.exports.table import Column, Table, Type
from rehab.people.covariates import age_band, months_since
from rehab.people.models import Patient
from rehab.sessions.log import MEASURE_UNIT
from rehab.sessions.models import TrainingSession
from rehab.training.plans import SessionPlan
from rehab.training.summary.metrics import METRICS


class SessionRow:
    """A session with its plan and metrics. ``source`` is empty where it may name somebody."""

    def __init__(self, session: TrainingSession, source: str) -> None:
        self.session, self.source = session, source
        self.plan: SessionPlan = session.to_plan()
        self.patient: Patient = session.patient
        self.day: date = session.began_at.date()

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


# --- options of the set-up ------------------------------------------------------------------------
SETUP: tuple[Column, ...] = (
    Column.number(
        "wanted_hit_rate",
        "ratio",
        "Share of steps at the goal that the therapist wanted.",
        "plan.target.hit_rate",
    ),
    Column.number("planned", "s", "Planned time of walking.", "plan.target.duration_s"),
    Column.number(
        "activation_threshold",
        "ratio",
        "Mean performance from which the robot responds.",
        "plan.activation_threshold",
    ),
    Column(
        "robot_rule",
        "What its gestures respond to: windows, streaks or steps.",
        "plan.cue_timing.rule.value",
    ),
    Column.number("robot_window", "s", "Length of a window.", "plan.cue_timing.window_s"),
    Column(
        "robot_count",
        "Steps of a streak, or of a group whose last step the robot responds to.",
        "plan.cue_timing.count",
        Type.INTEGER,
    ),
    Column.number(
        "robot_rest",
        "s",
        "Least time between the starts of two gestures.",
        "plan.cue_timing.rest_s",
    ),
    Column(
        "schedule",
        "When the patient got feedback: every, bandwidth, faded or summary.",
        "plan.schedule.kind.value",
    ),
    Column(
        "schedule_steps",
        "Steps from one feedback to the next (of faded: at most).",
        "plan.schedule.interval",
        Type.INTEGER,
    ),
    Column.number(
        "schedule_band",
        "ratio",
        "Half of the band about the goal without feedback.",
        "plan.schedule.band",
    ),
    Column("goal_follows", "off, suggest or automatic, as it began.", "plan.adaptation.mode.value"),
    Column.number(
        "close_part",
        "ratio",
        "Part of a value's 95 % interval beyond the goal that makes a step close; empty: none.",
        "plan.close_steps.part",
    ),
)
# --- end of the options of the set-up -------------------------------------------------------------

# What analyses adjust by, in bands: no date of birth or of the stroke.
PARTICIPANT: tuple[Column, ...] = (
    Column(
        "age_band",
        "Age when it began, by calendar years, in bands of ten.",
        lambda row: age_band(row.patient.birth_year, row.day),
        unit="years",
    ),
    Column(
        "months_since_stroke",
        "From the stroke to its beginning.",
        lambda row: months_since(row.patient.stroke_month, row.day),
        Type.INTEGER,
        "months",
    ),
    Column(
        "severity", "mild, moderate or severe, as the clinic judges it now.", "patient.severity"
    ),
    Column("paretic_side", "The leg that the stroke weakened.", "patient.paretic_side"),
)
# Conditions that are numbers: FHIR has them as observations.
CONDITIONS: tuple[Column, ...] = (
    Column.number("belt_speed", "m/s", "Speed of the treadmill's belt.", "session.belt_speed_m_s"),
    Column.number(
        "weight_support",
        "%",
        "Body weight that a harness carried.",
        "session.weight_support_percent",
    ),
)
FIGURES = tuple(_metric_column(m.slug, m.label, m.unit or "ratio") for m in METRICS.values())

SESSIONS = Table(
    "sessions.csv",
    _("a row for each session"),
    read_sessions,
    (
        Column("created_at", "When it was set up.", "session.created_at", Type.TIME),
        Column("started_at", "When the patient began to walk.", "session.started_at", Type.TIME),
        Column("ended_at", "When it ended.", "session.ended_at", Type.TIME),
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
        Column(
            "excluded",
            "true: a therapist left it out of figures (corrections.csv).",
            "session.excluded",
            Type.BOOLEAN,
        ),
        Column("measure", "What was trained; a2 is ankle push-off power.", "session.measure.slug"),
        Column("unit", "Unit of values and goals of this session.", "session.measure.unit"),
        Column("trained_side", "The leg whose steps count.", "session.trained_side"),
        Column.number("goal", MEASURE_UNIT, "Goal in force at the end.", "session.goal"),
        Column.number("walked", "s", "Time of walking, without pauses.", "session.active_s"),
        Column(
            "protocol",
            "Name of the list of phases it was built from.",
            lambda row: row.session.protocol and row.session.protocol.name,
        ),
        *SETUP,
        Column("simulated", "true: no person walked.", "session.simulated", Type.BOOLEAN),
        Column(
            "imported",
            "true: from the original GARRY, which stored no steps.",
            lambda row: row.session.legacy_id is not None,
            Type.BOOLEAN,
        ),
        Column("source", "Where its steps came from; empty for researchers.", "source"),
        *PARTICIPANT,
        Column("device", "What the patient walked on or with.", "session.device"),
        *CONDITIONS,
        *FIGURES,
    ),
)
