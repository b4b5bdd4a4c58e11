"""How somebody comes in: the password takes one halfway, a second factor the rest of the way.

Who is halfway is nobody to any page but those that ask for the second factor or set it up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any, cast

from django.contrib.auth import HASH_SESSION_KEY, SESSION_KEY, login, logout
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone
from django.utils.crypto import constant_time_compare

from rehab.people.models import User
from rehab.people.sign_in import browser_sessions, factors, lockout

HALFWAY = "halfway"
HALFWAY_S = 10 * 60
PROVEN = "second_factor"  # marks sign-ins that a second factor has proven
BACKEND = "rehab.people.sign_in.backends.PasswordBackend"


def begin(request: HttpRequest, user: User, then: str, now: datetime) -> bool:
    """Let in whom the password alone lets in; take anyone else halfway, and ``then`` further on.

    Gives whether that was all.
    """
    if not factors.is_required(user) and not factors.authenticators_of(user).exists():
        finish(request, user, now, proven=False)
        return True
    request.session.cycle_key()  # a key that somebody else may know gets nobody halfway
    request.session[HALFWAY] = {
        "then": then,
        "user": user.pk,
        "password": user.get_session_auth_hash(),
        "at": now.timestamp(),
    }
    return False


def halfway(request: HttpRequest, now: datetime) -> User | None:
    """Give the account whose password was right a moment ago; None where there is none."""
    half = request.session.get(HALFWAY)
    if half is None or now.timestamp() - half["at"] > HALFWAY_S:
        return None
    user = User.everywhere.select_related("clinic").filter(pk=half["user"], is_active=True).first()
    if user and constant_time_compare(half["password"], user.get_session_auth_hash()):
        return user
    return None


def setting_up(request: HttpRequest, now: datetime) -> User | None:
    """Give the account that is halfway and has no second factor yet, so that it may set one up.

    Who has one must prove it: a new one would be a way around.
    """
    user = halfway(request, now)
    return user if user and not factors.authenticators_of(user).exists() else None


def finish(request: HttpRequest, user: User, now: datetime, *, proven: bool) -> str:
    """Sign somebody in. Gives where the way halfway was to lead, "" where there was none."""
    half = request.session.pop(HALFWAY, {})
    login(request, user, backend=BACKEND)
    request.session[PROVEN] = proven
    request.session[browser_sessions.SIGNED_IN_AT] = int(now.timestamp())
    request.session[browser_sessions.SEEN_AT] = int(now.timestamp())
    lockout.forgive(user)
    return str(half.get("then", ""))


def holds(data: Mapping[str, Any], user: User) -> bool:
    """Whether the data of a browser session still sign this account in: it is not switched off,
    its password is the same, and it has proven a second factor where one is required by now.
    """
    return (
        user.is_active
        and data.get(SESSION_KEY) == str(user.pk)
        and constant_time_compare(data.get(HASH_SESSION_KEY, ""), user.get_session_auth_hash())
        and (bool(data.get(PROVEN)) or not factors.is_required(user))
    )


class EntryMiddleware:
    """Ends sign-ins that no longer hold, and notes that somebody is there. Keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        if request.user.is_authenticated:
            data = cast(Mapping[str, Any], request.session)
            if holds(data, request.user):
                browser_sessions.note(request, timezone.now())
            else:
                logout(request)
        return self.get_response(request)
