"""What all calls of the API share: who calls, who may, what is answered and what is refused.

A call declares its roles as pages do (`@for_roles` under the route); one that does not stops the
start of the server. Which rows are then seen is `visible_to`'s business.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import wraps
from typing import Annotated, Any, Generic, TypeVar

from django.conf import settings
from django.core.cache import cache
from django.core.exceptions import NON_FIELD_ERRORS
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils import timezone
from ninja import Field, Schema
from ninja.errors import HttpError
from ninja.security import HttpBearer
from ninja.security.apikey import APIKeyCookie
from ninja.throttling import BaseThrottle
from pydantic import AfterValidator, AwareDatetime, BeforeValidator, ConfigDict, StringConstraints

from rehab.people.access import UndeclaredView
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import find_caller

CALLS_A_MINUTE = 600  # of one person, on one server process
PAGE, PAGE_MAX = 50, 200
# One line of text without spaces around it, that any database can keep.
_LINE, _ENDS = r"[^\x00-\x1f\x7f-\x9f\u2028\u2029]", r"[^\x00-\x20\x7f-\x9f\u2028\u2029]"
Words = Annotated[str, StringConstraints(min_length=1, pattern=f"^{_ENDS}({_LINE}*{_ENDS})?$")]


def to_whole(number: object) -> object:
    """Take 1.0 for 1, as JSON does."""
    return int(number) if isinstance(number, float) and number.is_integer() else number


Whole = Annotated[int, BeforeValidator(to_whole)]
Key = Annotated[int, Field(ge=1, lt=2**63), BeforeValidator(to_whole)]


def no_bare_number(text: object) -> object:
    """Refuse seconds since 1970: a moment is written out."""
    if isinstance(text, str) and "-" not in text[1:]:
        raise ValueError("Give a date and a time with its zone, as 2026-11-21T09:30:00Z.")
    return text


def to_reach(moment: datetime) -> datetime:
    """Bring a moment to where databases can compare it: nothing happened before or after."""
    return min(max(moment, datetime(1900, 1, 1, tzinfo=UTC)), datetime(2200, 1, 1, tzinfo=UTC))


Moment = Annotated[AwareDatetime, BeforeValidator(no_bare_number), AfterValidator(to_reach)]


# --- who calls ----------------------------------------------------------------------------------


class Token(HttpBearer):
    """An API token of the admin: `Authorization: Bearer TOKEN`."""

    def authenticate(self, request: HttpRequest, token: str) -> User | None:
        """Give the person that the token speaks for."""
        return find_caller(token.strip(), timezone.now())


class Browser(APIKeyCookie):
    """A browser that is signed in; whatever changes something also needs the header X-CSRFToken."""

    param_name = settings.SESSION_COOKIE_NAME

    def __call__(self, request: HttpRequest) -> User | None:
        """Give who is signed in. A stranger hears that, and nothing of CSRF."""
        return super().__call__(request) if request.user.is_authenticated else None

    def authenticate(self, request: HttpRequest, key: str | None) -> User | None:
        """Give who is signed in."""
        return request.user if isinstance(request.user, User) else None


def caller(request: HttpRequest) -> User:
    """Give the person who calls."""
    user = getattr(request, "auth", None)
    if not isinstance(user, User):
        raise HttpError(401, "Sign in, or send an API token.")
    return user


def check_roles(call: Callable[..., Any]) -> Callable[..., Any]:
    """Hold a call to the roles that it declares. Raises UndeclaredView where it declares none."""
    roles: frozenset[Role] | None = getattr(call, "access", None)
    if not roles:
        raise UndeclaredView(
            f"The call {call!r} does not declare who may make it. Put @for_roles(…) from "
            "rehab.people.access under its route."
        )
    allowed = " or ".join(str(role.label) for role in Role if role in roles)

    @wraps(call)
    def checked(request: HttpRequest, **values: Any) -> Any:
        if caller(request).role not in roles:
            raise HttpError(403, f"This call is for other roles: {allowed}.")
        request.call = call  # type: ignore[attr-defined]  # for the audit log
        return call(request, **values)

    return checked


def sees_names(context: dict[str, Any]) -> bool:
    """Say whether an answer may name patients: researchers see pseudonyms only."""
    return caller(context["request"]).role in (Role.LEAD, Role.PT)


class PerPerson(BaseThrottle):
    """So many calls a minute, whoever makes them and however."""

    def allow_request(self, request: HttpRequest) -> bool:
        """Count a call."""
        key = f"api-calls-{caller(request).pk}-{int(time.time() // 60)}"
        cache.add(key, 0, 120)
        return cache.incr(key) <= CALLS_A_MINUTE

    def wait(self) -> float:
        """Give the seconds until the next minute begins."""
        return 60 - time.time() % 60


# --- what is answered ---------------------------------------------------------------------------


class Given(Schema):
    """What a caller sends. A name that is not known is refused: it may be a slip."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def left_out(**about: Any) -> Any:
    """Give the default of what may be left out, but not be null."""
    return Field(None, **about)


class Problem(Schema):
    """Why a call was refused, and the cure; ``fields`` by what was sent."""

    message: str
    fields: dict[str, str] = {}


class Rejected(Exception):
    """What was sent has the right shape but cannot be; ``fields`` say why ("": the whole)."""

    def __init__(self, fields: dict[str, str]) -> None:
        super().__init__(" ".join(fields.values()))
        self.fields = {name: words for name, words in fields.items() if name}


def answers(given: Any, *others: int, code: int = 200) -> dict[Any, Any]:
    """Give the answers that a call may have: its own, the refusals of all calls, and others."""
    refusals = sorted({400, 401, 403, 422, 429, *others})
    return {code: given, **dict.fromkeys(refusals, Problem)}


T = TypeVar("T")


class Page(Schema, Generic[T]):
    """A part of a list, and how long the whole is."""

    items: list[T]
    total: int


class Paging(Schema):
    """Which part of a list is wanted."""

    limit: int = Field(PAGE, ge=1, le=PAGE_MAX)
    offset: int = Field(0, ge=0, le=1_000_000)


def cut(rows: QuerySet[Any], paging: Paging) -> dict[str, Any]:
    """Give the part of some rows that is wanted."""
    return {
        "items": rows[paging.offset : paging.offset + paging.limit],
        "total": rows.count(),
    }


def say_errors(errors: Mapping[str, Any]) -> dict[str, str]:
    """Give a model's or form's objections by field; those to the whole stand under ""."""
    return {
        "" if name == NON_FIELD_ERRORS else name: " ".join(words) for name, words in errors.items()
    }
