"""What a patient takes home: what was walked and how it developed, in plain words."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import Count, F, Max, Q, QuerySet, Sum
from django.utils.translation import gettext as _

from rehab.people.models import User
from rehab.sessions.formatting import (
    clinic_time,
    format_day,
    format_duration,
    format_number,
    format_rate,
)
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import Point, read_trend
from rehab.training.measures import A2

SAME = 0.02  # a mean that differs by less is told as the same


@dataclass(frozen=True, slots=True)
class Bar:
    """A session's mean as a bar of a chart with two of them."""

    label: str
    value: str
    percent: float  # of the longer one


def sum_up_for_home(
    user: User, sessions: QuerySet[TrainingSession], now: datetime
) -> dict[str, Any]:
    """Give the words and figures of somebody's finished sessions; ``now`` is the clinic's clock."""
    counted = sessions.filter(metrics__slug="hit_rate", left_out=False)
    walked = counted.order_by("created_at", "pk").distinct()
    last = walked.last()
    alike = walked.filter(measure=last.measure) if last else walked
    first = alike.first()
    totals = walked.order_by().aggregate(Sum("active_s"), Count("pk"))
    steps = Step.objects.visible_to(user).filter(session__in=walked, valid=True)
    points = [
        point
        for session in (first, last)
        if session is not None
        for point in read_trend(
            user, TrainingSession.objects.visible_to(user).filter(pk=session.pk)
        )
    ]
    figures = SessionMetric.objects.visible_to(user).filter(session__in=walked).order_by()
    best = figures.aggregate(
        streak=Max("value", filter=Q(slug="best_streak")),
        rate=Max("value", filter=Q(slug="hit_rate")),
    )
    return {
        "count": totals["pk__count"],
        "minutes": format_duration(totals["active_s__sum"] or 0.0),
        "steps": format_number(steps.filter(side=F("session__trained_side")).count(), 0),
        "bars": _draw(points, now),
        "development": _develop(points),
        "last_hits": _of_ten(points[-1].hit_rate) if points else None,
        "best_hits": _of_ten(best["rate"]),
        "streak": format_number(best["streak"], 0) if best["streak"] else "",
        "measure": last.measure if last else None,
    }


def _of_ten(rate: float | None) -> int | None:
    return None if rate is None else round(10 * rate)


def _draw(points: list[Point], now: datetime) -> list[Bar]:
    means = [point.walked.mean for point in points if point.walked]
    longest = max(means, default=0.0)
    if len(means) < 2 or longest <= 0 or points[0].session == points[-1].session:
        return []
    labels = (_("First session"), _("Last session"))
    return [
        Bar(
            f"{label}, {format_day(_begun(point, now).date(), now.date())}",
            f"{format_number(mean)} {point.session.measure.unit}",
            round(100 * mean / longest, 1),
        )
        for label, point, mean in zip(labels, points, means, strict=True)
    ]


def _begun(point: Point, now: datetime) -> datetime:
    moment = point.session.started_at or point.session.created_at
    return clinic_time(moment, point.session.clinic).astimezone(now.tzinfo)


def _develop(points: list[Point]) -> str:
    """Say how the mean has changed. What became less is told as it is, without a judgement."""
    if len(points) < 2 or points[0].session == points[-1].session:
        return ""
    before, after = points[0].walked, points[-1].walked
    if before is None or after is None or before.mean <= 0:
        return ""
    measure = points[-1].session.measure
    change = after.mean / before.mean - 1
    is_push = measure.slug == A2.slug
    name = _("Your push-off") if is_push else _("Your %(measure)s") % {"measure": measure.name}
    said = {
        "what": name,
        "before": format_number(before.mean),
        "after": format_number(after.mean),
        "unit": measure.unit,
        "change": format_rate(abs(change)),
    }
    if abs(change) < SAME:
        return _("%(what)s stayed the same: %(after)s %(unit)s.") % said
    if change > 0:
        return _("%(what)s grew from %(before)s to %(after)s %(unit)s: %(change)s more.") % said
    return _("%(what)s went from %(before)s to %(after)s %(unit)s: %(change)s less.") % said
