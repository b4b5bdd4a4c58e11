"""The sessions that count on a board, with the metrics that it ranks by."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any

from django.db.models import CharField, OuterRef, QuerySet, Subquery
from django.db.models.functions import Cast

from rehab.boards.choices import CountedTypes
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.periods import Period
from rehab.boards.validation import POINT_METRICS
from rehab.people.simulated import counted
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State
from rehab.training.valences import VALENCES

# Ratios that are shown in percent.
PERCENT_METRICS = frozenset({"hit_rate", "mean_performance"})


@dataclass(frozen=True, slots=True)
class CountedSession:
    """A finished session that is long enough for a board.

    Attributes
    ----------
    values
        Its metrics by slug: those that the board uses, and those that say how long it was.
    miss_cost
        The points that a miss takes, at least 0; 0 where no metric of points was asked for.
    is_mixed
        Whether its feedback type was changed while it was walked.
    """

    session_id: int
    patient_id: int
    valence: str
    is_mixed: bool
    at: datetime
    day: date
    values: dict[str, float]
    miss_cost: int

    def figure(self, slug: str) -> float:
        """Return a metric in the unit that is shown; points that can only be lost as those kept.

        Where it is not known how many points were at stake, 0: imported sessions have points and
        may have no steps.
        """
        value = self.values.get(slug, 0.0) * (100 if slug in PERCENT_METRICS else 1)
        if not is_kept(slug, self.valence):
            return value
        at_stake = self.points_at_stake(slug)
        return at_stake + value if at_stake else 0.0

    def points_at_stake(self, slug: str) -> float:
        """Return the points that could be kept at most (steps × cost of a miss); else 0."""
        if not is_kept(slug, self.valence):
            return 0.0
        steps = 100 if slug == "points_per_100_steps" else self.values.get("steps", 0)
        return self.miss_cost * steps

    def counts_for(self, board: Leaderboard) -> bool:
        """Return whether it has the metric that a board ranks by, and is long enough for it."""
        return (
            board.metric in self.values
            and not (self.is_mixed and needs_one_valence(board))
            and self.is_long_enough(board)
            and (not is_kept(board.metric, self.valence) or self.points_at_stake(board.metric) > 0)
        )

    def is_long_enough(self, board: Leaderboard) -> bool:
        """Return whether it has the steps or the minutes that a board asks for."""
        steps, minutes = self.values.get("steps", 0), self.values.get("active_minutes", 0)
        return steps >= board.min_valid_strides or (
            board.min_minutes is not None and minutes >= board.min_minutes
        )


def read_sessions(
    board: Leaderboard,
    sessions: QuerySet[TrainingSession],
    period: Period,
    more_metrics: frozenset[str] = frozenset(),
    others: Sequence[Leaderboard] = (),
) -> Iterator[CountedSession]:
    """Yield the sessions that count on a board, grouped by patient and ordered by time.

    Parameters
    ----------
    sessions
        The sessions of the patients in question.
    more_metrics
        What to read besides the board's own metrics.
    others
        Boards on which a session may count instead, which admit no more sessions than this one.
    """
    slugs = sorted(
        {board.metric, board.tie_breaker, "steps", "active_minutes", *more_metrics} - {""}
    )
    columns = ["pk", "patient_id", "valence", "changed_to", "started_at"]
    columns += [f"metric_{slug}" for slug in slugs]
    if POINT_METRICS & set(slugs):
        columns.append("plan__valence__miss_points")
    ordered = (
        _narrow(board, sessions, period)
        .annotate(**{f"metric_{slug}": Subquery(_metric(slug)) for slug in slugs})
        .order_by("patient_id", "started_at", "pk")
        .values_list(*columns)
    )
    for pk, patient_id, valence, changed_to, at, *values in ordered.iterator(10_000):
        session = CountedSession(
            session_id=pk,
            patient_id=patient_id,
            valence=valence,
            is_mixed=bool(changed_to),
            at=at,
            day=period.day_of(at),
            values={
                slug: value for slug, value in zip(slugs, values, strict=False) if value is not None
            },
            miss_cost=-(values[-1] or 0) if len(values) > len(slugs) else 0,
        )
        if any(session.counts_for(each) for each in (board, *others)):
            yield session


def _metric(slug: str) -> QuerySet[SessionMetric, Any]:
    return SessionMetric.everywhere.filter(session=OuterRef("pk"), slug=slug).values("value")


def _narrow(
    board: Leaderboard, sessions: QuerySet[TrainingSession], period: Period
) -> QuerySet[TrainingSession]:
    """Return the sessions that a board's settings admit."""
    sessions = sessions.filter(state=State.FINISHED.value, started_at__isnull=False, excluded=False)
    if not board.include_simulated:
        sessions = sessions.filter(counted())
    if needs_one_valence(board):
        sessions = sessions.filter(changed_to="")
    if board.counted_valences:
        # Cast so that SQLite does not use the index of valences, which has all patients' sessions.
        sessions = sessions.alias(valence_text=Cast("valence", CharField()))
        sessions = sessions.filter(valence_text__in=board.counted_valences)
    if period.began is not None:
        sessions = sessions.filter(started_at__gte=period.began)
    if period.ended is not None:
        sessions = sessions.filter(started_at__lt=period.ended)
    if period.frozen_at is not None:
        sessions = sessions.exclude(ended_at__gte=period.frozen_at)
    return sessions


def needs_one_valence(board: Leaderboard) -> bool:
    """Return whether a board excludes sessions whose feedback type was changed."""
    by_points = {board.metric, board.tie_breaker} & POINT_METRICS
    return board.types != CountedTypes.ALL or bool(by_points)


def is_kept(slug: str, valence: str) -> bool:
    """Return whether a metric is shown as points kept: in this valence points can only be lost."""
    known = VALENCES.get(valence)
    return slug in POINT_METRICS and known is not None and known.has_points and not known.rewards
