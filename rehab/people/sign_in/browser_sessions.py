"""How long a sign-in lasts: as long as somebody is there, and one working day at most.

The cookie lasts for the day; when a sign-in ends, the database says. A page, or a training that
runs on one, puts the end off.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from django.conf import settings
from django.contrib.sessions.backends import db
from django.contrib.sessions.base_session import AbstractBaseSession
from django.contrib.sessions.models import Session
from django.http import HttpRequest
from django.utils import timezone

SIGNED_IN_AT = "signed_in_at"
SEEN_AT = "seen_at"
NOTED_EVERY = timedelta(minutes=1)  # that somebody is there is written down no more often


def idle_limit() -> timedelta:
    """Give how long nobody may be there."""
    return timedelta(minutes=settings.SESSION_MINUTES)


def ends_at(data: Mapping[str, Any], now: datetime) -> datetime:
    """Give when a browser session ends if nobody is there from now on."""
    end = now + idle_limit()
    begun = data.get(SIGNED_IN_AT)
    if begun is None:
        return end
    return min(
        end, datetime.fromtimestamp(begun, UTC) + timedelta(seconds=settings.SESSION_COOKIE_AGE)
    )


class SessionStore(db.SessionStore):
    """Browser sessions in the database, each with an end of its own."""

    @classmethod
    def get_model_class(cls) -> type[Session]:
        """Keep them in Django's own table."""
        return Session

    def create_model_instance(self, data: dict[str, Any]) -> AbstractBaseSession:
        """Make the row that is saved."""
        row = super().create_model_instance(data)
        row.expire_date = ends_at(data, timezone.now())
        return row


def note(request: HttpRequest, now: datetime) -> None:
    """Put off the end of a request's sign-in: somebody is there."""
    now_s = now.timestamp()
    if now_s - request.session.get(SEEN_AT, 0) >= NOTED_EVERY.total_seconds():
        request.session[SEEN_AT] = int(now_s)  # which saves it, with a new end


def keep(keys: Collection[str], now: datetime) -> None:
    """Put off the end of sign-ins whose pages watch a running training."""
    due = Session.objects.filter(
        session_key__in=keys,
        expire_date__gt=now,
        expire_date__lt=now + idle_limit() - NOTED_EVERY,
    )
    for row in due:
        end = ends_at(row.get_decoded(), now)
        Session.objects.filter(pk=row.pk, expire_date__gt=now).update(expire_date=end)
