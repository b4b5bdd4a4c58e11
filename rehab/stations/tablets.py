"""Paired tablets, recognized by the cookie that pairing has set."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

from django.conf import settings
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone

from rehab.people.networks import client_address
from rehab.stations.device_trust import UNUSED_FOR, find_ended
from rehab.stations.models import Device, Station
from rehab.stations.tokens import find_device

COOKIE = "garry_tablet"
COOKIE_AGE_S = UNUSED_FOR.total_seconds()  # each visit renews it
# Then a tablet that nobody touches goes back to its waiting page.
ENDING_STAYS_S, SCORES_STAY_S = 90, 60


def find_tablet(token: str | None, now: datetime, address: str = "") -> Device | None:
    """Return the tablet that this token belongs to; None for any other device."""
    device = find_device(token, now, address) if token and token.isascii() else None
    return device if device is not None and device.kind == Device.Kind.TABLET else None


def has_tablet(station: Station | None, now: datetime) -> bool:
    """Return whether a tablet is paired with a station, and may still show its sessions."""
    paired = Device.everywhere.filter(station=station, kind=Device.Kind.TABLET, revoked_at=None)
    return bool({one.pk for one in paired} - find_ended(paired, now))


def set_secret_cookie(response: HttpResponseBase, name: str, value: str, age_s: float) -> None:
    """Set a cookie that scripts cannot read."""
    response.set_cookie(
        name,
        value,
        max_age=int(age_s),
        httponly=True,
        samesite="Lax",
        secure=settings.SESSION_COOKIE_SECURE,
    )


class TabletMiddleware:
    """Sets ``request.tablet`` to the paired tablet of a request, or None. Keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        token = request.COOKIES.get(COOKIE)
        scheme, _, bearer = request.headers.get("Authorization", "").partition(" ")
        if token is None and scheme.lower() == "bearer":
            token = bearer.strip()
        request.tablet = find_tablet(  # type: ignore[attr-defined]
            token, timezone.now(), client_address(request)
        )
        return self.get_response(request)
