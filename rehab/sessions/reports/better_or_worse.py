"""What sessions came to, and whether one came to more than another: one threshold for all pages."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import Enum

from django.db.models import QuerySet

from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import load_own_trend

# A hit rate (in shares of steps) or a mean (in shares of itself) that differs by less is the same:
# two standard errors of the difference of two means of 50 strides (docs/reference/gait.md#phases).
SAME = 0.05
MOVED_GOAL = 0.02  # of the goal; beyond, hit rates do not compare


class Change(Enum):
    """How a figure compares with an earlier one."""

    MORE = "more"
    SAME = "same"
    LESS = "less"


def judge(difference: float, threshold: float = SAME) -> Change:
    """Return what a difference is called."""
    if abs(round(difference, 9)) < threshold:
        return Change.SAME
    return Change.MORE if difference > 0 else Change.LESS


@dataclass(frozen=True, slots=True)
class Result:
    """What a session came to, or some on average: hit rate, mean with feedback, goal at its end."""

    hit_rate: float
    mean: float | None
    goal: float | None
    began_at: datetime | None = None

    def compare_goal(self, before: Result) -> Change:
        """Return whether the goal was moved since an earlier result."""
        if not before.goal or not self.goal:
            return Change.SAME
        return judge(self.goal / before.goal - 1, MOVED_GOAL)

    def compare_hits(self, before: Result) -> Change:
        """Return whether more or fewer steps reached the goal than earlier."""
        return judge(self.hit_rate - before.hit_rate)


def find_counted(sessions: QuerySet[TrainingSession]) -> QuerySet[TrainingSession]:
    """Return the sessions with figures that no correction took out, oldest first."""
    counted = sessions.filter(excluded=False, metrics__slug="hit_rate")
    return counted.order_by("created_at", "pk")


def find_comparable(
    sessions: QuerySet[TrainingSession], last: TrainingSession
) -> QuerySet[TrainingSession]:
    """Return the counted sessions before the last one with its measure, leg and kind of walker."""
    return find_counted(sessions).filter(
        measure=last.measure_id,
        trained_side=last.trained_side,
        simulated=last.simulated,
        created_at__lt=last.created_at,
    )


def load_results(*sessions: TrainingSession) -> list[Result]:
    """Return the results of a patient's sessions, oldest first; none of one without figures.

    A paired tablet sees no earlier session, and yet shows them to the patient: the caller has
    checked that these may be seen.
    """
    rows = TrainingSession.everywhere.filter(pk__in=[session.pk for session in sessions])
    return [
        Result(
            point.hit_rate,
            point.with_feedback.mean if point.with_feedback else None,
            point.session.goal,
            point.session.began_at,
        )
        for point in load_own_trend(rows)
        if point.hit_rate is not None
    ]
