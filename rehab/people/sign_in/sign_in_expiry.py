"""How long a sign-in lasts: while there is activity, and one working day at most.

The cookie lasts for the day; the database decides when the session expires. Opening a page, and a
training session that runs on one, extend it.

Cookies hold a session's key and the database its digest, so that nobody who reads the database can
make a cookie of it.
"""

from __future__ import annotations

import hashlib
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
LAST_ACTIVITY_AT = "last_activity_at"
ACTIVITY_RESOLUTION = timedelta(minutes=1)  # activity is stored no more often than this
DIGEST_LENGTH = 40  # hexadecimal digits (160 bits): as many as Django's column has room for


def digest_of(key: str) -> str:
    """Return the digest under which the session of a cookie's key is stored."""
    return hashlib.sha256(key.encode()).hexdigest()[:DIGEST_LENGTH]


def idle_timeout() -> timedelta:
    """Return the time without activity after which a session expires."""
    return timedelta(minutes=settings.SESSION_MINUTES)


def expires_at(data: Mapping[str, Any], now: datetime) -> datetime:
    """Return when a browser session expires if there is no activity from now on."""
    end = now + idle_timeout()
    signed_in_at = data.get(SIGNED_IN_AT)
    if signed_in_at is None:
        return end
    longest = timedelta(seconds=settings.SESSION_COOKIE_AGE)
    return min(end, datetime.fromtimestamp(signed_in_at, UTC) + longest)


class SessionStore(db.SessionStore):
    """Browser sessions in the database, each with its own expiry. Nothing uses them async."""

    @classmethod
    def get_model_class(cls) -> type[Session]:
        """Return Django's own model."""
        return Session

    def create_model_instance(self, data: dict[str, Any]) -> AbstractBaseSession:
        """Return the row to save."""
        row = super().create_model_instance(data)
        row.session_key = digest_of(row.session_key)
        row.expire_date = expires_at(data, timezone.now())
        return row

    def load(self) -> dict[str, Any]:
        """Return the session's data; without a stored session none, and forget its key."""
        digest = digest_of(self.session_key or "")
        stored = Session.objects.filter(session_key=digest, expire_date__gt=timezone.now())
        row = stored.first()
        if row is None:
            self._session_key = None  # Django draws a new one when data are stored
            return {}
        data: dict[str, Any] = self.decode(row.session_data)
        return data

    def exists(self, session_key: str) -> bool:
        """Return whether there is a session with this key."""
        return super().exists(digest_of(session_key))

    def delete(self, session_key: str | None = None) -> None:
        """Delete the session of a key; without one, this session."""
        key = session_key or self.session_key
        if key is not None:
            super().delete(digest_of(key))


def record_activity(request: HttpRequest, now: datetime) -> None:
    """Extend the session of a request: there is activity."""
    now_s = now.timestamp()
    if now_s - request.session.get(LAST_ACTIVITY_AT, 0) >= ACTIVITY_RESOLUTION.total_seconds():
        request.session[LAST_ACTIVITY_AT] = int(now_s)  # saves the session, with a new expiry


def extend_sessions(keys: Collection[str], now: datetime) -> None:
    """Extend the sessions whose pages watch a running training session."""
    due = Session.objects.filter(
        session_key__in=[digest_of(key) for key in keys],
        expire_date__gt=now,
        expire_date__lt=now + idle_timeout() - ACTIVITY_RESOLUTION,
    )
    for row in due:
        end = expires_at(row.get_decoded(), now)
        Session.objects.filter(pk=row.pk, expire_date__gt=now).update(expire_date=end)
