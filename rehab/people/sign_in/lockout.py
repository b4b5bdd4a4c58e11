"""Who has guessed too often waits. django-axes counts; by what, and what is said, is here.

Passwords are counted by name and address, so that nobody can shut another one out from elsewhere.
Codes are counted by name alone: whoever tries those has the password already.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from axes.handlers.proxy import AxesProxyHandler
from axes.models import AccessAttempt
from axes.utils import reset
from django.conf import settings
from django.db.models import Max
from django.http import HttpRequest, HttpResponse
from django.utils.translation import ngettext

from rehab.people.models import User
from rehab.people.networks import client_address

CODES = " (code)"  # no username has a blank

Credentials = Mapping[str, Any] | None


def counted_name(request: HttpRequest, credentials: Credentials) -> str:
    """Give the name under which a try is counted."""
    name = str((credentials or request.POST).get("username") or "")
    return name[:150] + (CODES if "code" in (credentials or {}) else "")


def counted_by(request: Any, credentials: Credentials = None) -> list[str | list[str]]:
    """Give what makes two tries count together."""
    return ["username"] if "code" in (credentials or {}) else [["username", "ip_address"]]


def answer(request: HttpRequest, response: HttpResponse, credentials: Credentials) -> HttpResponse:
    """Let our own page, which says how long to wait, answer; machines read the status."""
    response.status_code = 429
    return response


def wait_of(request: HttpRequest, now: datetime, **credentials: str) -> str:
    """Say what to do where no more tries are taken; "" where they are."""
    if AxesProxyHandler.is_allowed(request, credentials):
        return ""
    name = counted_name(request, credentials)
    tries = AccessAttempt.objects.filter(username=name)
    if "code" not in credentials:
        tries = tries.filter(ip_address=client_address(request))
    last = tries.aggregate(last=Max("attempt_time"))["last"] or now
    left_s = (last + settings.AXES_COOLOFF_TIME - now).total_seconds()
    minutes = max(1, -int(-left_s // 60))
    return ngettext(
        "Too many wrong tries. Try again in a minute, or ask your clinic’s lead to unlock you.",
        "Too many wrong tries. Try again in %(minutes)d minutes, or ask your clinic’s lead to "
        "unlock you.",
        minutes,
    ) % {"minutes": minutes}


def forgive(user: User) -> None:
    """Take new tries for an account, of passwords and codes, from every address."""
    for name in (user.username, user.username + CODES):
        reset(username=name)
