"""The sessions of a day by the clinic's clock: for the dashboard and for the start list."""

from __future__ import annotations

from datetime import datetime, timedelta

from django.db.models import Q, QuerySet

from rehab.sessions.formatting import midnight_of
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES

IS_OPEN = Q(state__in=[state.value for state in OPEN_STATES])


def begun_today(now: datetime) -> Q:
    """Return the condition of sessions that were set up or started on the day of ``now``."""
    midnight = midnight_of(now)
    tomorrow = midnight + timedelta(days=1)
    created = Q(created_at__gte=midnight, created_at__lt=tomorrow)
    return created | Q(started_at__gte=midnight, started_at__lt=tomorrow)


def todays_sessions(
    sessions: QuerySet[TrainingSession], now: datetime
) -> QuerySet[TrainingSession]:
    """Return the sessions of the day of ``now`` and every open one, without their plans.

    ``now`` is in the clinic's time zone, which says when a day begins.
    """
    return sessions.filter(IS_OPEN | begun_today(now)).defer("plan")
