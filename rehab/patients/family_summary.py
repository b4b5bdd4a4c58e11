"""What a patient's family reads, in plain words and without a judgment of health.

The last weeks' sessions, how often the goal was reached, and the next visit.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime, time, timedelta

from django.db.models import Max, Q
from django.utils.translation import gettext as _

from rehab.patients.visits import Visit
from rehab.people.models import Patient
from rehab.sessions.formatting import format_number
from rehab.sessions.models import TrainingSession

WEEKS = 6  # of sessions that are listed
COMPARED = 3  # sessions on either side of "before"
SAME = 0.05  # a share of hits that changed by less counts as unchanged


@dataclass(frozen=True, slots=True)
class Walk:
    """A session, as the page has it."""

    day: date
    minutes: int
    hits: int  # of ten steps
    percent: float  # of all steps, for its bar
    points: str  # empty where none were won


@dataclass(frozen=True, slots=True)
class FamilySummary:
    """The page's figures, newest session first, and its sentence."""

    walks: list[Walk]
    sentence: str
    next_day: date | None
    next_at: time | None


def summarize_for_family(patient: Patient, now: datetime) -> FamilySummary:
    """Return what a patient's family reads; ``now`` is in the clinic's time zone."""
    sessions = (
        TrainingSession.everywhere.filter(
            patient=patient,
            simulated=patient.simulated,
            excluded=False,
            created_at__gte=now - timedelta(weeks=WEEKS),
        )
        .annotate(
            rate=Max("metrics__value", filter=Q(metrics__slug="hit_rate")),
            points=Max("metrics__value", filter=Q(metrics__slug="score")),
        )
        .filter(rate__isnull=False)
        .order_by("-created_at", "-pk")
    )
    walks = [
        Walk(
            session.began_at.astimezone(now.tzinfo).date(),
            max(1, round(session.active_s / 60)),
            round(10 * session.rate),
            round(100 * session.rate, 1),
            # Some types only take points: what is below nothing would be read as a failure.
            format_number(session.points, 0) if (session.points or 0) > 0 else "",
        )
        for session in sessions
    ]
    planned = Visit.everywhere.filter(patient=patient, day__gte=now.date())
    visit = planned.exclude(day=now.date(), at__lt=now.time()).order_by("day", "at").first()
    sentence = describe_change([session.rate for session in sessions])
    next_day, next_at = (visit.day, visit.at) if visit else (None, None)
    return FamilySummary(walks, sentence, next_day, next_at)


def describe_change(rates: list[float]) -> str:
    """Return in a sentence how the share of hits has changed; newest first, empty for few."""
    if len(rates) < 2 * COMPARED:
        return ""
    late = sum(rates[:COMPARED]) / COMPARED
    early = sum(rates[COMPARED : 2 * COMPARED]) / COMPARED
    if abs(late - early) < SAME:
        return _("In the last three sessions as many steps reached the goal as in those before.")
    if late > early:
        return _("In the last three sessions more steps reached the goal than in those before.")
    return _("In the last three sessions fewer steps reached the goal than in those before.")
