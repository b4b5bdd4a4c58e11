"""The sign-in: first the password, then a second factor for accounts that have or need one.

Between the two a sign-in is pending. Its account counts as signed out on every page but those that
ask for the second factor or enroll one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any, cast

from django.contrib.auth import HASH_SESSION_KEY, SESSION_KEY, login, logout
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone

from rehab.people.models import User
from rehab.people.sign_in import lockout, sign_in_expiry
from rehab.people.sign_in.factors import factors
from rehab.people.sign_in.known_browsers import remember_browser

# Keys of the browser session.
PENDING = "pending_second_factor"
SECOND_FACTOR_VERIFIED = "second_factor_verified"

PENDING_LIFETIME_S = 10 * 60
BACKEND = "rehab.people.sign_in.authentication_backends.PasswordBackend"


def begin(request: HttpRequest, user: User, next_url: str, now: datetime) -> bool:
    """Sign in an account that needs its password alone; else wait for its second factor.

    ``next_url`` is stored for `finish`. Return whether the account is signed in now.
    """
    if not factors.is_required(user) and not factors.authenticators_of(user).exists():
        finish(request, user, now, second_factor_verified=False)
        return True
    request.session.cycle_key()  # against session fixation
    request.session[PENDING] = {
        "next_url": next_url,
        "user": user.pk,
        "password": user.get_session_auth_hash(),
        "at": now.timestamp(),
    }
    return False


def pending_second_factor(request: HttpRequest, now: datetime) -> User | None:
    """Return the account whose password was right a moment ago; None where there is none."""
    pending = request.session.get(PENDING)
    if pending is None or now.timestamp() - pending["at"] > PENDING_LIFETIME_S:
        return None
    accounts = User.everywhere.select_related("clinic")
    user = accounts.filter(pk=pending["user"], is_active=True).first()
    if user and user.has_session_hash(pending["password"]):
        return user
    return None


def pending_enrollment(request: HttpRequest, now: datetime) -> User | None:
    """Return the pending account that has no second factor yet and may therefore enroll one.

    An account that has one must use it: enrolling another would get around it.
    """
    user = pending_second_factor(request, now)
    return user if user and not factors.authenticators_of(user).exists() else None


def finish(request: HttpRequest, user: User, now: datetime, *, second_factor_verified: bool) -> str:
    """Sign an account in. Return the ``next_url`` of `begin`, "" where there was none."""
    pending = request.session.pop(PENDING, {})
    login(request, user, backend=BACKEND)
    request.session[SECOND_FACTOR_VERIFIED] = second_factor_verified
    request.session[sign_in_expiry.SIGNED_IN_AT] = int(now.timestamp())
    request.session[sign_in_expiry.LAST_ACTIVITY_AT] = int(now.timestamp())
    lockout.forget_failures(request, user, now)
    return str(pending.get("next_url", ""))


def is_session_valid(data: Mapping[str, Any], user: User) -> bool:
    """Return whether the data of a browser session still sign this account in.

    The account must be active, its password the same, and a second factor verified where one is
    required by now.
    """
    return (
        user.is_active
        and data.get(SESSION_KEY) == str(user.pk)
        and user.has_session_hash(data.get(HASH_SESSION_KEY, ""))
        and (bool(data.get(SECOND_FACTOR_VERIFIED)) or not factors.is_required(user))
    )


WATCHING = "Garry-Watching"  # a page asks by itself (static/js/shared/alarms.js): no activity


class SessionValidationMiddleware:
    """Signs out sessions that are no longer valid and records activity. Keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        was_signed_in = request.user.is_authenticated
        if isinstance(request.user, User):
            data = cast(Mapping[str, Any], request.session)
            if is_session_valid(data, request.user):
                if WATCHING not in request.headers:
                    sign_in_expiry.record_activity(request, timezone.now())
            else:
                logout(request)
        response = self.get_response(request)
        if not was_signed_in and isinstance(request.user, User):
            remember_browser(response, request.user)
        return response
