"""The clinic's week so far, from Monday: totals, by feedback type and by day."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from django.db.models import Count, F, OuterRef, QuerySet, Subquery
from django.utils.dateformat import format as format_date
from django.utils.translation import gettext

from rehab.people.models import Clinic, User
from rehab.sessions.formatting import (
    clinic_time,
    format_duration,
    format_number,
    format_rate,
    midnight_of,
)
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import with_metrics
from rehab.training.valences import VALENCES


@dataclass(frozen=True, slots=True)
class WeekTotals:
    """What was walked with one feedback type, or with all; rates are weighted by judged steps."""

    slug: str
    label: str
    sessions: int
    minutes: float
    strides: int
    hit_rate: float | None
    target_hit_rate: float | None

    @property
    def formatted(self) -> dict[str, str]:
        """The figures as text."""
        return {
            "minutes": format_duration(60 * self.minutes),
            "strides": format_number(self.strides, 0),
            "hit_rate": format_rate(self.hit_rate),
            "target_hit_rate": format_rate(self.target_hit_rate),
        }


@dataclass(frozen=True, slots=True)
class WeekSummary:
    """Monday to now. ``simulated``: no person has walked, so these are simulated sessions."""

    total: WeekTotals
    types: list[WeekTotals]
    days: list[str]
    minutes: list[float]
    simulated: bool
    excluded: int

    @property
    def chart(self) -> dict[str, Any]:
        """The data of the chart."""
        return {
            "days": self.days,
            "minutes": [round(minutes, 1) for minutes in self.minutes],
        }


def week_summary(user: User, clinic: Clinic, now: datetime) -> WeekSummary:
    """Return the figures of the clinic's week so far, without sessions that a correction excluded.

    Simulated sessions count only where no person has walked.
    """
    local = clinic_time(now, clinic)
    monday = midnight_of(local - timedelta(days=local.weekday()))
    begun = TrainingSession.objects.visible_to(user).filter(
        started_at__gte=monday, started_at__lte=now
    )
    steps = SessionMetric.objects.visible_to(user).filter(session=OuterRef("pk"), slug="steps")
    rows = list(
        with_metrics(user, begun)
        .annotate(judged=Subquery(steps.values("value")))
        .order_by()
        .values(
            *("pk", "valence", "simulated", "excluded", "active_s", "started_at"),
            *("metric_hit_rate", "judged", "plan__target__hit_rate"),
        )
    )
    counted = [row for row in rows if not row["excluded"]]
    simulated = bool(counted) and all(row["simulated"] for row in counted)
    counted = [row for row in counted if row["simulated"] == simulated]
    strides = _count_strides(user, begun.filter(excluded=False, simulated=simulated))
    minutes = [0.0] * 7
    for row in counted:
        minutes[clinic_time(row["started_at"], clinic).weekday()] += row["active_s"] / 60
    return WeekSummary(
        total=_total("", "", counted, sum(strides.values())),
        types=[
            _total(kind.slug, kind.label, own, strides[kind.slug])
            for kind in VALENCES.values()
            if (own := [row for row in counted if row["valence"] == kind.slug])
        ],
        days=[format_date(monday + timedelta(days=day), "D") for day in range(7)],
        minutes=minutes,
        simulated=simulated,
        excluded=len(rows) - len(counted),
    )


def _count_strides(user: User, sessions: QuerySet[TrainingSession]) -> defaultdict[str, int]:
    """Return the number of valid strides of the trained leg by feedback type."""
    found: defaultdict[str, int] = defaultdict(int)
    rows = (
        Step.objects.visible_to(user)
        .filter(session__in=sessions.values("pk"), valid=True)
        .filter(side=F("session__trained_side"))
        .values_list("session__valence")
        .annotate(Count("pk"))
        .order_by()
    )
    found.update(rows)
    return found


def _total(slug: str, label: str, rows: list[dict[str, Any]], strides: int) -> WeekTotals:
    judged = [row for row in rows if row["metric_hit_rate"] is not None and row["judged"]]
    with_target = [row for row in judged if row["plan__target__hit_rate"] is not None]
    return WeekTotals(
        slug=slug,
        label=gettext(label) if label else "",
        sessions=len(rows),
        minutes=sum(row["active_s"] for row in rows) / 60,
        strides=strides,
        hit_rate=_mean(judged, "metric_hit_rate"),
        target_hit_rate=_mean(with_target, "plan__target__hit_rate"),
    )


def _mean(rows: list[dict[str, Any]], name: str) -> float | None:
    """Return the mean of a rate, weighted by judged steps; None without any."""
    weight = sum(row["judged"] for row in rows)
    return sum(row[name] * row["judged"] for row in rows) / weight if weight else None
