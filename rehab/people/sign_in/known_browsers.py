"""Where somebody has signed in lately: the networks, and the browsers, which keep a cookie.

They keep their clinic's lane through a flood of sign-ins (`flood_gate`). A lane says nothing of who
may sign in.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from datetime import datetime, timedelta

from channels.db import database_sync_to_async
from django.conf import settings
from django.core.signing import BadSignature, TimestampSigner
from django.db import Error
from django.db.models import QuerySet
from django.http import HttpResponseBase
from django.urls import reverse
from django.utils import timezone

from rehab.people.audit.audit_log import Act, AuditEntry, truncate_address
from rehab.people.models import User

log = logging.getLogger(__name__)

KNOWN_FOR = timedelta(days=30)
READ_AGAIN_AFTER = timedelta(minutes=1)
COOKIE = "garry_known"
HOSTS = 0  # the lane of those who have no clinic

signer = TimestampSigner(salt="garry.known")


def find_known_networks(now: datetime) -> dict[str, int]:
    """Return the networks from which somebody has signed in lately, each with its lane.

    Of two clinics behind one address the last that signed in counts.
    """
    rows = _sign_ins(now).order_by("at").values_list("address", "clinic")
    return {address: clinic or HOSTS for address, clinic in rows.iterator()}


def is_known_network(address: str, now: datetime) -> bool:
    """Return whether somebody has signed in lately from the network of an address."""
    return _sign_ins(now).filter(address=truncate_address(address)).exists()


def _sign_ins(now: datetime) -> QuerySet[AuditEntry]:
    return AuditEntry.everywhere.filter(act=Act.SIGN_IN, at__gt=now - KNOWN_FOR)


def remember_browser(response: HttpResponseBase, user: User) -> None:
    """Let a browser in which somebody has just signed in keep the lane of the clinic."""
    response.set_cookie(
        COOKIE,
        signer.sign(str(user.clinic_id or HOSTS)),
        max_age=int(KNOWN_FOR.total_seconds()),
        path=reverse("sign-in"),
        httponly=True,
        samesite="Lax",
        secure=settings.SESSION_COOKIE_SECURE,
    )


def lane_of_browser(cookies: Mapping[str, str]) -> int | None:
    """Return the lane that a browser keeps; None where nobody has signed in there lately."""
    try:
        return int(signer.unsign(cookies.get(COOKIE, ""), max_age=KNOWN_FOR))
    except (BadSignature, ValueError):
        return None


class Lanes:
    """Which lane a browser or network keeps. Networks are read at most once a minute."""

    def __init__(self) -> None:
        self._networks: dict[str, int] = {}
        self._read_at: datetime | None = None
        self._reading = asyncio.Lock()

    async def find(self, cookies: Mapping[str, str], address: str) -> int | None:
        """Return the lane of a browser at an address; None for strangers."""
        lane = lane_of_browser(cookies)
        if lane is not None:
            return lane
        async with self._reading:
            now = timezone.now()
            if self._read_at is None or not abs(now - self._read_at) < READ_AGAIN_AFTER:
                self._read_at = now
                await self._read(now)
        return self._networks.get(truncate_address(address))

    async def _read(self, now: datetime) -> None:
        try:
            self._networks = await database_sync_to_async(find_known_networks)(now)
        except Error:
            log.exception("The networks of past sign-ins cannot be read")
