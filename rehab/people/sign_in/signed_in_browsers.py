"""The browsers in which an account is signed in, for its owner: what they are and from where.

Each browser session notes that at its sign-in. `User.end_sign_ins` ends them all.
"""

from __future__ import annotations

import re
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from django.contrib.sessions.models import Session
from django.http import HttpRequest

from rehab.people.audit.audit_log import truncate_address
from rehab.people.models import User
from rehab.people.networks import client_address
from rehab.people.sign_in.sign_in_expiry import LAST_ACTIVITY_AT, SIGNED_IN_AT
from rehab.people.sign_in.two_stage_sign_in import is_session_valid

BROWSER = "browser"  # key of the browser session: its mark, program and network

# A browser names others that it is compatible with, so the first of these that it names counts.
PROGRAMS = {"Firefox": "Firefox", "Edg": "Edge", "OPR": "Opera", "Chrome": "Chrome"}
PROGRAMS |= {"HeadlessChrome": "Chrome", "CriOS": "Chrome", "FxiOS": "Firefox"}
PROGRAMS |= {"Safari": "Safari"}
SYSTEMS = {"Android": "Android", "iPad": "iPad", "iPhone": "iPhone", "Windows": "Windows"}
SYSTEMS |= {"Mac OS X": "macOS", "CrOS": "ChromeOS", "Linux": "Linux"}


@dataclass(frozen=True, slots=True)
class SignedInBrowser:
    """A browser in which an account is signed in."""

    name: str
    network: str
    signed_in_at: datetime
    last_active_at: datetime
    is_this: bool


def note_browser(sender: Any, request: HttpRequest, user: Any, **_: Any) -> None:
    """Note in a new sign-in what it runs in. A receiver of Django's `user_logged_in`."""
    request.session[BROWSER] = {
        "mark": secrets.token_hex(8),
        "name": describe_browser(request.META.get("HTTP_USER_AGENT", "")),
        "network": truncate_address(client_address(request)),
    }


def describe_browser(agent: str) -> str:
    """Return program and system of a User-Agent, such as “Firefox, Windows”; "" for unknown."""
    found = [
        next((name for word, name in known.items() if re.search(rf"\b{word}\b", agent)), "")
        for known in (PROGRAMS, SYSTEMS)
    ]
    return ", ".join(filter(None, found))


def browsers_of(user: User, request: HttpRequest, now: datetime) -> list[SignedInBrowser]:
    """Return the browsers in which an account is signed in, the last active one first."""
    here = request.session.get(BROWSER, {}).get("mark")
    browsers = []
    for data in _sign_ins_of(user, now):
        noted = data.get(BROWSER, {})
        signed_in_s = data.get(SIGNED_IN_AT, 0)
        browsers.append(
            SignedInBrowser(
                name=noted.get("name", ""),
                network=noted.get("network", ""),
                signed_in_at=datetime.fromtimestamp(signed_in_s, UTC),
                last_active_at=datetime.fromtimestamp(data.get(LAST_ACTIVITY_AT, signed_in_s), UTC),
                is_this=here is not None and noted.get("mark") == here,
            )
        )
    return sorted(browsers, key=lambda one: one.last_active_at, reverse=True)


def _sign_ins_of(user: User, now: datetime) -> Iterator[dict[str, Any]]:
    """Yield the browser sessions of an account. Whose one is stands inside it, so all are read."""
    for row in Session.objects.filter(expire_date__gt=now).iterator():
        data = row.get_decoded()
        if is_session_valid(data, user):
            yield data
