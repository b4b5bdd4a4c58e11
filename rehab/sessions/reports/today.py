"""The sessions of a day by the clinic's clock: for the dashboard and for the start list."""

from __future__ import annotations

from datetime import datetime, timedelta

from django.db.models import Q, QuerySet

from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN

IS_OPEN = Q(state__in=[state.value for state in OPEN])


def start_of_day(now: datetime) -> datetime:
    """Return midnight before ``now``, in its time zone."""
    return now.replace(hour=0, minute=0, second=0, microsecond=0)


def begun_today(now: datetime) -> Q:
    """Return the condition of sessions that were set up or started on the day of ``now``."""
    midnight = start_of_day(now)
    day = (midnight, midnight + timedelta(days=1))
    created = Q(created_at__gte=day[0], created_at__lt=day[1])
    return created | Q(started_at__gte=day[0], started_at__lt=day[1])


def todays_sessions(
    sessions: QuerySet[TrainingSession], now: datetime
) -> QuerySet[TrainingSession]:
    """Return the sessions of the day of ``now`` and every open one, without their plans.

    ``now`` is in the clinic's time zone, which says when a day begins.
    """
    return sessions.filter(IS_OPEN | begun_today(now)).defer("plan")
