"""Lockout after too many failed attempts. django-axes counts; what it counts by is defined here.

Passwords are counted by name and address, so that nobody can lock another person out from
elsewhere. Codes are counted by name alone: a person who tries those has the password already.
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

CODE_SUFFIX = " (code)"  # no username contains a space

Credentials = Mapping[str, Any] | None


def attempt_username(request: HttpRequest, credentials: Credentials) -> str:
    """Return the name under which an attempt is counted."""
    name = str((credentials or request.POST).get("username") or "")
    return name[:150] + (CODE_SUFFIX if "code" in (credentials or {}) else "")


def lockout_parameters(request: Any, credentials: Credentials = None) -> list[str | list[str]]:
    """Return the parameters by which attempts are counted together."""
    return ["username"] if "code" in (credentials or {}) else [["username", "ip_address"]]


def lockout_response(
    request: HttpRequest, response: HttpResponse, credentials: Credentials
) -> HttpResponse:
    """Return our own page, which says how long to wait, with the status 429."""
    response.status_code = 429
    return response


def lockout_message(request: HttpRequest, now: datetime, **credentials: str) -> str:
    """Return a message with the time to wait during a lockout; "" where there is none."""
    if AxesProxyHandler.is_allowed(request, credentials):
        return ""
    name = attempt_username(request, credentials)
    attempts = AccessAttempt.objects.filter(username=name)
    if "code" not in credentials:
        attempts = attempts.filter(ip_address=client_address(request))
    last = attempts.aggregate(last=Max("attempt_time"))["last"] or now
    left_s = (last + settings.AXES_COOLOFF_TIME - now).total_seconds()
    minutes = max(1, -int(-left_s // 60))
    return ngettext(
        "Too many wrong tries. Try again in a minute, or ask your clinic’s lead to unlock you.",
        "Too many wrong tries. Try again in %(minutes)d minutes, or ask your clinic’s lead to "
        "unlock you.",
        minutes,
    ) % {"minutes": minutes}


def reset_attempts(user: User) -> None:
    """End the lockouts of an account, of passwords and codes, from every address."""
    for name in (user.username, user.username + CODE_SUFFIX):
        reset(username=name)
