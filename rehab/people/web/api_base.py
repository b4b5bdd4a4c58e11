"""What all API calls share: authentication, roles, request and response schemas.

A call declares its roles as pages do (`@for_roles` under the route); the server does not start with
one that does not. Which rows it returns is decided by `visible_to`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import wraps
from typing import Annotated, Any, Generic, TypeVar

import pydantic
from django.conf import settings
from django.core.exceptions import NON_FIELD_ERRORS
from django.db.models import QuerySet
from django.http import HttpRequest
from django.urls import reverse
from django.utils import timezone
from ninja import Field, Schema
from ninja.errors import HttpError
from ninja.security import HttpBearer
from ninja.security.apikey import APIKeyCookie
from ninja.throttling import BaseThrottle
from pydantic import AfterValidator, BeforeValidator, ConfigDict, StringConstraints

from rehab.people import clinic_limits, roles
from rehab.people.access import UndeclaredView
from rehab.people.audit import sign_in_log
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.sign_in.tokens import TokenScope, find_user_by_token
from rehab.people.token_buckets import TokenBuckets

CALLS_A_MINUTE = 600
PAGE_SIZE, MAX_PAGE_SIZE = 50, 200
# One line of text without spaces around it, without characters that databases refuse.
_LINE, _ENDS = r"[^\x00-\x1f\x7f-\x9f\u2028\u2029]", r"[^\x00-\x20\x7f-\x9f\u2028\u2029]"
TextLine = Annotated[str, StringConstraints(min_length=1, pattern=f"^{_ENDS}({_LINE}*{_ENDS})?$")]


def accept_integral_float(number: object) -> object:
    """Convert 1.0 to 1: JSON does not distinguish them."""
    return int(number) if isinstance(number, float) and number.is_integer() else number


StrictInt = Annotated[int, BeforeValidator(accept_integral_float)]
Key = Annotated[int, Field(ge=1, lt=2**63), BeforeValidator(accept_integral_float)]


def reject_timestamp(text: object) -> object:
    """Refuse seconds since 1970: a time is written out."""
    if isinstance(text, str) and "-" not in text[1:]:
        raise ValueError("Write a date and a time with its zone, as 2026-11-21T09:30:00Z.")
    return text


def clamp_datetime(moment: datetime) -> datetime:
    """Limit a time to years that databases can compare; all rows are from within."""
    return min(max(moment, datetime(1900, 1, 1, tzinfo=UTC)), datetime(2200, 1, 1, tzinfo=UTC))


AwareDatetime = Annotated[
    pydantic.AwareDatetime, BeforeValidator(reject_timestamp), AfterValidator(clamp_datetime)
]


# --- the caller ----------------------------------------------------------------------------------


class TokenAuth(HttpBearer):
    """An API token of the admin: `Authorization: Bearer TOKEN`."""

    def authenticate(self, request: HttpRequest, token: str) -> User | None:
        """Return the person that the token speaks for."""
        user = find_user_by_token(token.strip(), timezone.now())
        if user is not None:
            sign_in_log.record_token_use(user, request)
        return user


class SessionAuth(APIKeyCookie):
    """A signed-in browser. Calls that change something also need the header X-CSRFToken."""

    param_name = settings.SESSION_COOKIE_NAME

    def __call__(self, request: HttpRequest) -> User | None:
        """Return the signed-in person. Strangers are refused before CSRF is checked."""
        return super().__call__(request) if request.user.is_authenticated else None

    def authenticate(self, request: HttpRequest, key: str | None) -> User | None:
        """Return the signed-in person."""
        return request.user if isinstance(request.user, User) else None


def caller(request: HttpRequest) -> User:
    """Return the person who calls. Raises HttpError for a stranger."""
    user = getattr(request, "auth", None)
    if not isinstance(user, User):
        raise HttpError(401, "Sign in, or send an API token.")
    return user


def check_roles(call: Callable[..., Any]) -> Callable[..., Any]:
    """Limit a call to the roles that it declares. Raises UndeclaredView where it declares none."""
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
        check_token_scope(request, call)
        request.call = call  # type: ignore[attr-defined]  # for the audit log
        return call(request, **values)

    return checked


def check_token_scope(request: HttpRequest, call: Callable[..., Any]) -> None:
    """Raise HttpError where a program's token does not allow a call, and for data that leave by a
    browser in which nobody has shown lately who it is.
    """
    user = caller(request)
    scope = TokenScope.READ
    if request.method not in ("GET", "HEAD", "OPTIONS"):
        scope = TokenScope.STEER
    elif getattr(call, "exports", False):
        scope = TokenScope.EXPORT
    if user.program:
        if scope.value not in user.program_scopes:
            raise HttpError(
                403, f"This token lacks the scope {scope.value}. Have one made that has it."
            )
    elif scope == TokenScope.EXPORT and not step_up.is_confirmed(request, timezone.now()):
        raise HttpError(403, f"First show at {reverse('confirm')} who you are, or send a token.")


def may_see_names(context: dict[str, Any]) -> bool:
    """Return whether a response may name patients: researchers see pseudonyms only."""
    return roles.may_see_names(caller(context["request"]).role)


# Of one person, on one server process.
calls = TokenBuckets(CALLS_A_MINUTE, 60 / CALLS_A_MINUTE)


class PerUserThrottle(BaseThrottle):
    """Limits the calls per minute of one person, through all tokens and browsers."""

    def allow_request(self, request: HttpRequest) -> bool:
        """Count a call. Return whether it is within the limits; browsers' clinics are counted."""
        user = caller(request)
        wait_s = calls.take(user.pk, time.monotonic())
        return not (wait_s or (user.program and clinic_limits.take_request(user.clinic_id)))

    def wait(self) -> float:
        """Return the seconds after which there is room for a call again."""
        return max(1.0, calls.interval_s)


# --- requests and responses ---------------------------------------------------------------------


class RequestBody(Schema):
    """The body of a request. Unknown names are refused: they may be typing errors."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def optional(**description: Any) -> Any:
    """Return a field that may be omitted but not be null."""
    return Field(None, **description)


class Problem(Schema):
    """Why a call was refused, and the cure; ``fields`` by the names that were sent."""

    message: str
    fields: dict[str, str] = {}


class Rejected(Exception):
    """A valid body that models or forms refuse; ``fields`` has the reasons ("": the whole)."""

    def __init__(self, fields: dict[str, str]) -> None:
        super().__init__(" ".join(fields.values()))
        self.fields = {name: words for name, words in fields.items() if name}


def responses(schema: Any, *others: int, code: int = 200) -> dict[Any, Any]:
    """Return the responses of a call: its own, the refusals of all calls, and others."""
    refusals = sorted({400, 401, 403, 422, 429, *others})
    return {code: schema, **dict.fromkeys(refusals, Problem)}


T = TypeVar("T")


class Page(Schema, Generic[T]):
    """A part of a list, and the length of the whole."""

    items: list[T]
    total: int


class Paging(Schema):
    """The part of a list that is requested."""

    limit: int = Field(PAGE_SIZE, ge=1, le=MAX_PAGE_SIZE)
    offset: int = Field(0, ge=0, le=1_000_000)


def paginate(rows: QuerySet[Any], paging: Paging) -> dict[str, Any]:
    """Return the requested part of the rows."""
    return {
        "items": rows[paging.offset : paging.offset + paging.limit],
        "total": rows.count(),
    }


def format_errors(errors: Mapping[str, Any]) -> dict[str, str]:
    """Return the errors of a model or form by field; those of the whole under ""."""
    return {
        "" if name == NON_FIELD_ERRORS else name: " ".join(words) for name, words in errors.items()
    }
