"""The page that a patient takes home: what was walked and how it developed, in plain words."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from typing import Any

from django.db.models import Count, F, Max, Q, QuerySet, Sum
from django.utils.translation import gettext as _

from rehab.people.models import User
from rehab.sessions.formatting import (
    format_day,
    format_duration,
    format_number,
    format_rate,
)
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import TrendPoint, load_trend
from rehab.training.measures import A2

SAME = 0.02  # a mean that changed by less counts as unchanged


@dataclass(frozen=True, slots=True)
class Bar:
    """A session's mean as a bar of a chart with two of them."""

    label: str
    value: str
    percent: float  # of the longer one


def summarize_for_patient(
    user: User, sessions: QuerySet[TrainingSession], now: datetime
) -> dict[str, Any]:
    """Return the page's texts and figures of finished sessions; ``now`` in the clinic's zone."""
    included = sessions.filter(metrics__slug="hit_rate", excluded=False)
    walked = included.order_by("created_at", "pk").distinct()
    last = walked.last()
    comparable = walked.filter(measure=last.measure) if last else walked
    first = comparable.first()
    totals = walked.order_by().aggregate(Sum("active_s"), Count("pk"))
    steps = Step.objects.visible_to(user).filter(session__in=walked, valid=True)
    points = [
        point
        for session in (first, last)
        if session is not None
        for point in load_trend(
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
        "bars": _mean_bars(points, now),
        "development": _describe_change(points),
        "last_hits": _out_of_ten(points[-1].hit_rate or 0.0) if points else None,
        "best_hits": _out_of_ten(best["rate"]),
        "streak": format_number(best["streak"], 0) if best["streak"] else "",
        "measure": last.measure if last else None,
    }


def _out_of_ten(rate: float | None) -> int | None:
    return None if rate is None else round(10 * rate)


def _mean_bars(points: list[TrendPoint], now: datetime) -> list[Bar]:
    means = [point.with_feedback.mean for point in points if point.with_feedback]
    longest = max(means, default=0.0)
    if len(means) < 2 or longest <= 0 or points[0].session == points[-1].session:
        return []
    labels = (_("First session"), _("Last session"))
    return [
        Bar(
            f"{label}, {format_day(_local_day(point, now), now.date())}",
            f"{format_number(mean)} {point.session.measure.unit}",
            round(100 * mean / longest, 1),
        )
        for label, point, mean in zip(labels, points, means, strict=True)
    ]


def _local_day(point: TrendPoint, now: datetime) -> date:
    return point.session.began_at.astimezone(now.tzinfo).date()


def _describe_change(points: list[TrendPoint]) -> str:
    """Return how the mean has changed as text. A decrease is stated without a judgment."""
    if len(points) < 2 or points[0].session == points[-1].session:
        return ""
    before, after = points[0].with_feedback, points[-1].with_feedback
    if before is None or after is None or before.mean <= 0:
        return ""
    measure = points[-1].session.measure
    change = after.mean / before.mean - 1
    is_push = measure.slug == A2.slug
    name = _("Your push-off") if is_push else _("Your %(measure)s") % {"measure": measure.name}
    values = {
        "what": name,
        "before": format_number(before.mean),
        "after": format_number(after.mean),
        "unit": measure.unit,
        "change": format_rate(abs(change)),
    }
    if abs(change) < SAME:
        return _("%(what)s stayed the same: %(after)s %(unit)s.") % values
    if change > 0:
        return _("%(what)s grew from %(before)s to %(after)s %(unit)s: %(change)s more.") % values
    return _("%(what)s went from %(before)s to %(after)s %(unit)s: %(change)s less.") % values
