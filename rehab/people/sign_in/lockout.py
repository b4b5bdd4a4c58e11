"""Lockout after too many failed attempts: what is counted together, and which message people get.

Passwords are counted by name and address, so that nobody can lock another person out from
elsewhere; by address, whatever the name; and by name, but not where the account has signed in
lately. Codes and passkeys are counted by name alone: who tries those has the password already.

`backends.CountingBackend` asks before each attempt.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from typing import Any

from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from rehab.people.audit import sign_in_log
from rehab.people.models import User
from rehab.people.networks import client_address
from rehab.people.sign_in import attempt_counter
from rehab.people.sign_in.attempt_counter import Limit
from rehab.people.sign_in.hashing import BUSY_S, HashingBusy

FACTORS = ("code", "passkey")  # the credentials of second factors
OWN_FAILURES = 5  # wrong passwords for a name from an address; wrong codes or passkeys for a name
ADDRESS_FAILURES = 30  # wrong passwords from an address: a clinic's staff may share one
NAME_FAILURES = 50  # wrong passwords for a name, from addresses that the account does not use

Credentials = Mapping[str, Any]


def limits_of(request: HttpRequest, credentials: Credentials, now: datetime) -> list[Limit]:
    """Return the limits under which an attempt is counted."""
    name = str(credentials.get("username") or "")[:150]
    for kind in FACTORS:
        if kind in credentials:
            return [Limit(kind, OWN_FAILURES, name)]
    address = client_address(request)
    own = _password_limit(name, address)
    limits = [own, Limit("address", ADDRESS_FAILURES, address=address)]
    if not attempt_counter.is_known(own, now):
        limits.append(Limit("name", NAME_FAILURES, name))
    return limits


def _password_limit(name: str, address: str) -> Limit:
    return Limit("password", OWN_FAILURES, name, address)


def is_allowed(request: HttpRequest, credentials: Credentials) -> bool:
    """Count an attempt; return whether it may be checked."""
    now = timezone.now()
    wait = attempt_counter.count(limits_of(request, credentials, now), now)
    _note_lockout(request, wait)
    return not wait


def record_lockout(
    sender: Any, credentials: Credentials, request: HttpRequest | None = None, **_: Any
) -> None:
    """Record a lockout, also one that begins with this failure.

    A receiver of Django's `user_login_failed`.
    """
    if request is None:
        return
    now = timezone.now()
    if not lockout_s(request):
        _note_lockout(
            request, attempt_counter.time_to_wait(limits_of(request, credentials, now), now)
        )
    if lockout_s(request):
        sign_in_log.record_lockout(credentials.get("username"), request)


def take_back(request: HttpRequest | None, **credentials: str) -> None:
    """Take back an attempt that was right, or was not checked after all."""
    if request is not None:
        attempt_counter.take_back(limits_of(request, credentials, timezone.now()))


def forget_failures(request: HttpRequest, user: User, now: datetime) -> None:
    """Forget the failures of an account that has just signed in, here."""
    password = _password_limit(user.username, client_address(request))
    of_factors = [Limit(kind, OWN_FAILURES, user.username) for kind in FACTORS]
    attempt_counter.forget([password, *of_factors], now)


def lockout_s(request: HttpRequest) -> int:
    """Return how many seconds an attempt of this request has to wait; 0 without a lockout."""
    return int(getattr(request, "lockout_s", 0))


def _note_lockout(request: HttpRequest, wait: timedelta) -> None:
    request.lockout_s = -int(-wait.total_seconds() // 1)  # type: ignore[attr-defined]


def lockout_message(request: HttpRequest) -> str:
    """Return a message with the time to wait during a lockout; "" where there is none."""
    if not lockout_s(request):
        return ""
    minutes = -(-lockout_s(request) // 60)
    return ngettext(
        "Too many wrong attempts. Try again in a minute, or ask your clinic’s lead to unlock you.",
        "Too many wrong attempts. Try again in %(minutes)d minutes, or ask your clinic’s lead to "
        "unlock you.",
        minutes,
    ) % {"minutes": minutes}


class LockoutMiddleware:
    """Answers with status 429 and Retry-After where an attempt has to wait. Keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        response = self.get_response(request)
        if lockout_s(request):
            response.status_code = 429
            response.headers["Retry-After"] = str(lockout_s(request))
        return response

    def process_exception(self, request: HttpRequest, exception: Exception) -> HttpResponse | None:
        """Answer for passwords that could not be checked now."""
        if not isinstance(exception, HashingBusy):
            return None
        _note_lockout(request, timedelta(seconds=BUSY_S))
        words = _("Too many people are signing in right now. Wait a moment, and try again.")
        return render(request, "people/sign_in/busy.html", {"words": words}, status=429)
