"""The trend over a patient's sessions: hit rate, mean value, baseline and goal of each."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import Avg, Count, Exists, F, OuterRef, Q, QuerySet, Subquery
from django.utils.text import capfirst
from django.utils.translation import gettext

from rehab.people.models import User
from rehab.sessions.formatting import (
    format_change,
    format_day,
    format_duration,
    format_number,
    format_quantity,
    format_rate,
)
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.training.phases import Phase

FIGURES = ("score", "hit_rate", "improvement_over_baseline")
SESSIONS = 30  # more cannot be distinguished in a chart


@dataclass(frozen=True, slots=True)
class Spread:
    """Count, mean and standard deviation of some values."""

    count: int
    mean: float
    deviation: float

    @classmethod
    def pool(cls, parts: Sequence[tuple[int, float, float]]) -> Spread | None:
        """Pool (count, mean, mean of squares) of several samples; None without a value."""
        count = sum(part[0] for part in parts)
        if not count:
            return None
        mean = sum(n * m for n, m, _ in parts) / count
        squares = sum(n * s for n, _, s in parts) / count
        return cls(count, mean, math.sqrt(max(0.0, squares - mean * mean)))


@dataclass(frozen=True, slots=True)
class TrendPoint:
    """A session of the trend, with the values of its feedback phases and of its baseline.

    An imported session has its points and no hit rate.
    """

    session: TrainingSession
    hit_rate: float | None
    score: float | None
    target_hit_rate: float | None
    with_feedback: Spread | None
    baseline: Spread | None

    @property
    def change(self) -> float | None:
        """Change of the mean from the baseline (ratio), positive for the better direction."""
        if self.with_feedback is None or self.baseline is None or self.baseline.mean <= 0:
            return None
        ratio = self.with_feedback.mean / self.baseline.mean - 1
        return ratio if self.session.measure.higher_is_better else -ratio


def metrics_by_session(
    user: User, sessions: Sequence[TrainingSession]
) -> dict[int, dict[str, float]]:
    """Return score, hit rate and improvement of sessions by their keys."""
    return _read_figures(SessionMetric.objects.visible_to(user), sessions)


def _read_figures(
    metrics: QuerySet[SessionMetric], sessions: Sequence[TrainingSession]
) -> dict[int, dict[str, float]]:
    found: dict[int, dict[str, float]] = defaultdict(dict)
    rows = metrics.filter(session__in=[session.pk for session in sessions], slug__in=FIGURES)
    for session_id, slug, value in rows.values_list("session_id", "slug", "value").order_by():
        found[session_id][slug] = value
    return found


def with_metrics(user: Any, sessions: QuerySet[TrainingSession]) -> QuerySet[TrainingSession]:
    """Annotate sessions with ``metric_score`` and ``metric_hit_rate``."""
    figure = SessionMetric.objects.visible_to(user).filter(session=OuterRef("pk")).values("value")
    return sessions.annotate(
        metric_score=Subquery(figure.filter(slug="score")),
        metric_hit_rate=Subquery(figure.filter(slug="hit_rate")),
    )


def load_trend(
    user: User,
    sessions: QuerySet[TrainingSession],
    *,
    with_imported: bool = False,
    most: int = SESSIONS,
) -> list[TrendPoint]:
    """Return the newest of these sessions that have a hit rate, oldest first, at most so many.

    ``with_imported``: also those from the original GARRY, which have points alone.
    """
    metrics, steps = SessionMetric.objects.visible_to(user), Step.objects.visible_to(user)
    return _read_trend(sessions, metrics, steps, with_imported=with_imported, most=most)


def load_own_trend(sessions: QuerySet[TrainingSession]) -> list[TrendPoint]:
    """Return the trend of one patient's sessions, for a page that shows them to this patient.

    A tablet sees no earlier session, and shows its figures all the same. The caller has checked
    that the session at hand may be seen, and that no other patient's is among them.
    """
    steps = Step.everywhere.all()
    return _read_trend(sessions, SessionMetric.everywhere.all(), steps, with_imported=False)


def _read_trend(
    sessions: QuerySet[TrainingSession],
    metrics: QuerySet[SessionMetric],
    steps: QuerySet[Step],
    *,
    with_imported: bool,
    most: int = SESSIONS,
) -> list[TrendPoint]:
    rate = metrics.filter(session=OuterRef("pk"), slug="hit_rate")
    wanted = Exists(rate) | Q(legacy_id__isnull=False) if with_imported else Q(Exists(rate))
    counted = sessions.filter(wanted, excluded=False)
    ended = counted.select_related("measure")
    newest = list(ended.order_by("-created_at", "-pk")[:most])[::-1]
    figures, values = _read_figures(metrics, newest), _values_by_phase(steps, newest)
    points: list[TrendPoint] = []
    for session in newest:
        plan, parts = session.to_plan(), values[session.pk]
        points.append(
            TrendPoint(
                session=session,
                hit_rate=figures[session.pk].get("hit_rate"),
                score=figures[session.pk].get("score"),
                target_hit_rate=plan.target.hit_rate,
                with_feedback=_pool(parts, plan.phases, lambda phase: phase.feedback),
                baseline=_pool(parts, plan.phases, lambda phase: phase.kind == "baseline"),
            )
        )
    return points


Parts = dict[int, tuple[int, float, float]]


def _values_by_phase(
    steps: QuerySet[Step], sessions: Sequence[TrainingSession]
) -> defaultdict[int, Parts]:
    """Return count, mean and mean square of the trained leg's valid values by session and phase."""
    found: defaultdict[int, Parts] = defaultdict(dict)
    judged = steps.filter(
        session__in=[session.pk for session in sessions],
        valid=True,
        side=F("session__trained_side"),
    )
    rows = judged.values_list("session_id", "phase").annotate(
        Count("value"), Avg("value"), square=Avg(F("value") * F("value"))
    )
    for session_id, phase, count, mean, square in rows.order_by():
        found[session_id][phase] = (count, mean, square)
    return found


def _pool(parts: Parts, phases: Sequence[Phase], wanted: Callable[[Phase], bool]) -> Spread | None:
    return Spread.pool(
        [part for index, part in parts.items() if index < len(phases) and wanted(phases[index])]
    )


def summarize_trend(
    groups: list[dict[str, Any]], trend: list[TrendPoint], *, simulated: bool
) -> dict[str, Any]:
    """Return the figures above the charts."""
    last = next((point for point in reversed(trend) if point.hit_rate is not None), None)
    counted = [group for group in groups if group["simulated"] == simulated]
    wanted, means = last and last.target_hit_rate, ""
    if last and last.with_feedback and last.baseline:
        unit = last.session.measure.unit
        after = format_quantity(last.with_feedback.mean, unit)
        means = f"{format_number(last.baseline.mean)} → {after}"
    return {
        "hit_rate": format_rate(last.hit_rate if last else None),
        "target_hit_rate": format_rate(wanted) if wanted else "",
        "change": format_change(last.change if last else None),
        "means": means,
        "measure": gettext(last.session.measure.name) if last else "",
        "duration": format_duration(sum(group["active_s"] for group in counted)),
        "count": sum(group["pk__count"] for group in counted),
        "excluded": 0
        if simulated
        else sum(group["pk__count"] for group in groups if group["simulated"]),
    }


def trend_chart_data(trend: list[TrendPoint], now: datetime) -> dict[str, Any]:
    """Return the data of both charts, with days in the time zone of ``now``.

    Values are those of the newest session's measure alone.
    """
    measure = trend[-1].session.measure if trend else None

    starts = {point.session.pk: point.session.began_at.astimezone(now.tzinfo) for point in trend}
    per_day = Counter(start.date() for start in starts.values())

    def day(point: TrendPoint) -> str:
        start = starts[point.session.pk]
        label = capfirst(format_day(start.date(), now.date()))
        label = f"{label} {start:%H:%M}" if per_day[start.date()] > 1 else label
        is_imported = point.session.legacy_id is not None
        return f"{label} · {gettext('imported')}" if is_imported else label

    comparable = [point for point in trend if point.session.measure == measure]
    trained = [point.with_feedback for point in comparable]
    return {
        "hits": {
            "days": [day(point) for point in trend],
            "joined": len({point.session.valence for point in trend}) == 1,
            "types": [_type_of(point.session) for point in trend],
            "hit": [to_percent(point.hit_rate) for point in trend],
            "wanted": [to_percent(point.target_hit_rate) for point in trend],
        },
        "values": {
            "days": [day(point) for point in comparable],
            "types": [_type_of(point.session) for point in comparable],
            "mean": [spread and round(spread.mean, 3) for spread in trained],
            "deviation": [spread and round(spread.deviation, 3) for spread in trained],
            "baseline": [point.baseline and round(point.baseline.mean, 3) for point in comparable],
            "goal": [point.session.goal and round(point.session.goal, 3) for point in comparable],
            "unit": measure.unit if measure else "",
        },
    }


def _type_of(session: TrainingSession) -> str:
    """Return the slug of a session's feedback type; one that was changed is none of one type."""
    return "" if session.changed_to else session.valence


def to_percent(rate: float | None) -> float | None:
    """Return a rate in percent, as charts draw it."""
    return None if rate is None else round(100 * rate, 1)
