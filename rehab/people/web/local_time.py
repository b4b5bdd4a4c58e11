"""The time zone of pages: that of the clinic of the person or tablet of the request.

Django's templates and the admin format times in the current time zone, whatever zone a value has.
A host's pages are in the server's (GARRY_TIME_ZONE); programs get times with their offset.
"""

from __future__ import annotations

from collections.abc import Callable
from zoneinfo import ZoneInfo

from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone

from rehab.people.access import tablet_of
from rehab.people.models import User
from rehab.people.web.language import API_PREFIX


def request_time_zone(request: HttpRequest) -> ZoneInfo | None:
    """Return the time zone of the clinic of a request; None where there is none."""
    if request.path_info.startswith(API_PREFIX):
        return None
    user = request.user
    clinic = getattr(user if isinstance(user, User) else tablet_of(request), "clinic", None)
    return ZoneInfo(clinic.time_zone) if clinic else None


class LocalTimeMiddleware:
    """Formats times in the clinic's time zone. Sync and thread-safe: it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on; then restore the time zone of this thread."""
        with timezone.override(request_time_zone(request)):
            return self.get_response(request)
