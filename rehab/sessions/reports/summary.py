"""The main figures of one session as text: for its page and for its report on paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from rehab.people.models import User
from rehab.sessions.alarms import Alarm, Incident, fold_incidents
from rehab.sessions.formatting import (
    MISSING,
    clinic_time,
    format_change,
    format_duration,
    format_number,
    format_quantity,
    format_rate,
)
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.review import SessionReview
from rehab.sessions.reports.trend import TrendPoint, load_trend
from rehab.training.changes import ChangeKind
from rehab.training.plans import SessionPlan
from rehab.training.valences import VALENCES


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure as text, with a note beside it."""

    label: str
    value: str
    note: str


@dataclass(frozen=True, slots=True)
class SessionSummary:
    """The figures that a session's page and its report share."""

    hit_rate: Figure
    score: Figure
    goal: Figure
    duration: Figure
    strides: Figure


def format_summary(plan: SessionPlan, review: SessionReview) -> SessionSummary:
    """Return the main figures of a session."""
    figures, target = review.figures, plan.target
    has_score = plan.valence.has_points or figures["score"] is not None
    goal_changes = sum(entry.event.kind == ChangeKind.GOAL for entry in review.events)
    not_counted = figures["missing"] + figures["invalid"]
    return SessionSummary(
        hit_rate=Figure(
            _("Hit rate"),
            format_rate(figures["hit_rate"]),
            ", ".join(_describe_rate(target.hit_rate, figures["close"])),
        ),
        score=Figure(
            _("Score"),
            format_number(figures["score"], 0) if has_score else MISSING,
            _("points") if has_score else _("this type has no points"),
        ),
        goal=Figure(
            _("Goal"),
            format_number(figures["goal"]),
            plan.measure.unit
            + (_(", changed %(count)s ×") % {"count": goal_changes} if goal_changes else ""),
        ),
        duration=Figure(
            _("Walked"),
            format_duration(figures["active_s"]),
            _("planned %(time)s") % {"time": format_duration(target.duration_s)}
            if target.duration_s
            else "",
        ),
        strides=Figure(
            _("Strides"),
            format_number(figures["strides"], 0),
            ", ".join(_describe_not_counted(not_counted, figures["late"])),
        ),
    )


def load_point(user: User, session: TrainingSession) -> TrendPoint | None:
    """Return a session's point of the trend; None of one without figures."""
    points = load_trend(user, TrainingSession.objects.visible_to(user).filter(pk=session.pk))
    return points[0] if points else None


def format_first_goal(user: User, last: TrainingSession | None, initial: dict[str, Any]) -> str:
    """Return what the proposed share of the baseline was in the last session; "" if unknown."""
    percent = initial["goal_percent"]
    if last is None or initial["measure"] != last.measure or not percent:
        return ""
    point = load_point(user, last)
    if point is None or point.baseline is None:
        return ""
    return format_quantity(point.baseline.mean * float(percent) / 100, last.measure.unit)


def format_mean(session: TrainingSession, point: TrendPoint | None) -> Figure:
    """Return the mean of the phases with feedback, beside its baseline."""
    if point is None or point.with_feedback is None:
        why = _("not computed: this session is left out") if session.excluded else ""
        return Figure(_("Mean with feedback"), MISSING, why)
    change = _("no baseline")
    if point.baseline:
        values = {
            "mean": format_number(point.baseline.mean),
            "change": format_change(point.change),
        }
        change = _("%(change)s from baseline %(mean)s") % values
    return Figure(
        _("Mean with feedback"),
        format_number(point.with_feedback.mean),
        f"{session.measure.unit}, {change}",
    )


def format_incidents(review: SessionReview, session: TrainingSession) -> list[Figure]:
    """Return a figure for falls and one for the robot's own stops, where there were any."""
    found = [one for one in fold_incidents(review.rows) if one.was_one]
    labels = {Alarm.FALL: _("Falls"), Alarm.ROBOT_STOP: _("Robot stopped by itself")}
    figures = []
    for kind, label in labels.items():
        some = [one for one in found if one.raised.kind == kind]
        if some:
            notes = [_describe_incident(one, session) for one in some]
            figures.append(Figure(label, format_number(len(some), 0), "; ".join(notes)))
    return figures


def _describe_incident(incident: Incident, session: TrainingSession) -> str:
    parts = [f"{clinic_time(incident.raised.at, session.clinic):%H:%M}"]
    if incident.severity is not None:
        parts.append(str(incident.severity.label))
    if incident.ended is None:
        parts.append(_("not seen yet"))
    else:
        seen_at = clinic_time(incident.ended.at, session.clinic)
        parts.append(_("seen %(time)s") % {"time": f"{seen_at:%H:%M}"})
    return ", ".join(parts)


def _describe_not_counted(count: int, late: int) -> list[str]:
    """Return how many strides do not count, and how many do not by the lab's delay."""
    notes = []
    if count:
        about = ngettext("%(count)s does not count", "%(count)s do not count", count)
        why = _("not clearly measured")
        notes.append(f"{about % {'count': format_number(count, 0)}}: {why}")
    if late:
        about = ngettext(
            "of %(count)s the samples came late", "of %(count)s the samples came late", late
        )
        notes.append(about % {"count": format_number(late, 0)})
    return notes


def _describe_rate(wanted: float | None, close: int) -> list[str]:
    """Return what stands beside a hit rate: the wanted one, and how many steps are not in it."""
    notes = [_("wanted %(rate)s") % {"rate": format_rate(wanted)}] if wanted else []
    if close:
        about = ngettext("%(count)s step was close", "%(count)s steps were close", close)
        notes.append(about % {"count": format_number(close, 0)})
    return notes


def format_phases(review: SessionReview) -> list[dict[str, Any]]:
    """Return the figures of each phase with their texts beside them."""
    return [
        phase
        | {
            "hit_rate_text": format_rate(phase["hit_rate"]),
            "mean_text": format_number(phase["mean"]),
            "performance_text": format_rate(phase["mean_performance"]),
            "valence_label": _(VALENCES[phase["valence"]].label) if phase["valence"] else "",
        }
        for phase in review.figures["phases"]
    ]
