"""How a patient's sessions develop: hits, mean value, baseline and goal of each."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import Avg, Count, F, OuterRef, QuerySet, Subquery

from rehab.people.models import User
from rehab.sessions.formatting import (
    format_day,
    format_duration,
    format_number,
    format_quantity,
    format_rate,
)
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.training.phases import Phase

SESSIONS = 30  # as many as a chart can tell apart


@dataclass(frozen=True, slots=True)
class Spread:
    """Count, mean and standard deviation of some values."""

    count: int
    mean: float
    deviation: float

    @classmethod
    def join(cls, parts: Sequence[tuple[int, float, float]]) -> Spread | None:
        """Join (count, mean, mean of squares) of several sets; None without a value."""
        count = sum(part[0] for part in parts)
        if not count:
            return None
        mean = sum(n * m for n, m, _ in parts) / count
        squares = sum(n * s for n, _, s in parts) / count
        return cls(count, mean, math.sqrt(max(0.0, squares - mean * mean)))


@dataclass(frozen=True, slots=True)
class Point:
    """A session of the trend. ``walked`` covers its feedback phases, ``baseline`` its baseline."""

    session: TrainingSession
    hit_rate: float
    wanted: float | None
    walked: Spread | None
    baseline: Spread | None

    @property
    def gain(self) -> float | None:
        """Change of the mean over the baseline (ratio), positive for the better direction."""
        if self.walked is None or self.baseline is None or self.baseline.mean <= 0:
            return None
        change = self.walked.mean / self.baseline.mean - 1
        return change if self.session.measure.higher_is_better else -change


def figures_of(user: User, sessions: Sequence[TrainingSession]) -> dict[int, dict[str, float]]:
    """Give score and hit rate of sessions, by their keys."""
    found: dict[int, dict[str, float]] = defaultdict(dict)
    rows = SessionMetric.objects.visible_to(user).filter(
        session__in=[session.pk for session in sessions], slug__in=("score", "hit_rate")
    )
    for session_id, slug, value in rows.values_list("session_id", "slug", "value").order_by():
        found[session_id][slug] = value
    return found


def with_figures(user: Any, sessions: QuerySet[TrainingSession]) -> QuerySet[TrainingSession]:
    """Give sessions with ``metric_score`` and ``metric_hit_rate``, to be read and ordered by."""
    figure = SessionMetric.objects.visible_to(user).filter(session=OuterRef("pk")).values("value")
    return sessions.annotate(
        metric_score=Subquery(figure.filter(slug="score")),
        metric_hit_rate=Subquery(figure.filter(slug="hit_rate")),
    )


def read_trend(user: User, sessions: QuerySet[TrainingSession]) -> list[Point]:
    """Give the newest of these sessions that have a hit rate, oldest first."""
    counted = sessions.filter(metrics__slug="hit_rate", left_out=False)
    ended = counted.select_related("measure")
    newest = list(ended.order_by("-created_at", "-pk")[:SESSIONS])[::-1]
    figures, values = figures_of(user, newest), _values_by_phase(user, newest)
    points: list[Point] = []
    for session in newest:
        plan, parts = session.to_plan(), values[session.pk]
        points.append(
            Point(
                session=session,
                hit_rate=figures[session.pk]["hit_rate"],
                wanted=plan.target.hit_rate,
                walked=_join(parts, plan.phases, lambda phase: phase.feedback),
                baseline=_join(parts, plan.phases, lambda phase: phase.kind == "baseline"),
            )
        )
    return points


Parts = dict[int, tuple[int, float, float]]


def _values_by_phase(user: User, sessions: Sequence[TrainingSession]) -> defaultdict[int, Parts]:
    """Give count, mean and mean square of the trained leg's valid values, session and phase."""
    found: defaultdict[int, Parts] = defaultdict(dict)
    steps = (
        Step.objects.visible_to(user)
        .filter(session__in=[session.pk for session in sessions], valid=True)
        .filter(side=F("session__trained_side"))
    )
    rows = steps.values_list("session_id", "phase").annotate(
        Count("value"), Avg("value"), square=Avg(F("value") * F("value"))
    )
    for session_id, phase, count, mean, square in rows.order_by():
        found[session_id][phase] = (count, mean, square)
    return found


def _join(parts: Parts, phases: Sequence[Phase], wanted: Callable[[Phase], bool]) -> Spread | None:
    return Spread.join(
        [part for index, part in parts.items() if index < len(phases) and wanted(phases[index])]
    )


def sum_up_all(
    groups: list[dict[str, Any]], trend: list[Point], *, simulated: bool
) -> dict[str, Any]:
    """Give the figures above the charts."""
    last = trend[-1] if trend else None
    counted = [group for group in groups if group["simulated"] == simulated]
    gain = last.gain if last else None
    means = ""
    if last and last.walked and last.baseline:
        unit = last.session.measure.unit
        means = f"{format_number(last.baseline.mean)} → {format_quantity(last.walked.mean, unit)}"
    return {
        "hit_rate": format_rate(last.hit_rate if last else None),
        "wanted": format_rate(last.wanted) if last and last.wanted else "",
        "gain": ("+" if gain and gain > 0 else "") + format_rate(gain),
        "means": means,
        "measure": last.session.measure.name if last else "",
        "walked": format_duration(sum(group["walked"] for group in counted)),
        "count": sum(group["pk__count"] for group in counted),
        "left_out": 0
        if simulated
        else sum(group["pk__count"] for group in groups if group["simulated"]),
    }


def draw_trend(trend: list[Point], now: datetime) -> dict[str, Any]:
    """Give the data of both charts, its days by the clock of ``now``.

    Values are those of the newest session's measure alone.
    """
    measure = trend[-1].session.measure if trend else None

    begun = {
        point.session.pk: (point.session.started_at or point.session.created_at).astimezone(
            now.tzinfo
        )
        for point in trend
    }
    a_day = Counter(start.date() for start in begun.values())

    def day(point: Point) -> str:
        start = begun[point.session.pk]
        words = format_day(start.date(), now.date()).capitalize()
        return f"{words} {start:%H:%M}" if a_day[start.date()] > 1 else words

    alike = [point for point in trend if point.session.measure == measure]
    return {
        "hits": {
            "days": [day(point) for point in trend],
            "hit": [round(100 * point.hit_rate, 1) for point in trend],
            "wanted": [point.wanted and round(100 * point.wanted, 1) for point in trend],
        },
        "values": {
            "days": [day(point) for point in alike],
            "mean": [point.walked and round(point.walked.mean, 3) for point in alike],
            "deviation": [point.walked and round(point.walked.deviation, 3) for point in alike],
            "baseline": [point.baseline and round(point.baseline.mean, 3) for point in alike],
            "goal": [point.session.goal and round(point.session.goal, 3) for point in alike],
            "unit": measure.unit if measure else "",
        },
    }
