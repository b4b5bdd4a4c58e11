"""Which clock a page shows: that of the clinic of the person or tablet that asks.

Django's templates and the admin write moments by the current time zone, whatever zone a value has.
A host's pages have the server's (GARRY_TIME_ZONE); programs get moments with their offset.
"""

from __future__ import annotations

from collections.abc import Callable
from zoneinfo import ZoneInfo

from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone

from rehab.people.access import tablet_of
from rehab.people.models import User
from rehab.people.web.language import FOR_PROGRAMS


def zone_of(request: HttpRequest) -> ZoneInfo | None:
    """Return the time zone of the clinic of whoever asks; None where there is none."""
    if request.path_info.startswith(FOR_PROGRAMS):
        return None
    user = request.user
    clinic = getattr(user if isinstance(user, User) else tablet_of(request), "clinic", None)
    return ZoneInfo(clinic.time_zone) if clinic else None


class LocalTimeMiddleware:
    """Writes moments by the clinic's clock. Sync and thread-safe: it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on; afterwards this thread is in the zone that it was in."""
        with timezone.override(zone_of(request)):
            return self.get_response(request)
