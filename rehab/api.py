"""Gathers the rooms' calls into one API, and says what is refused in one way."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import wraps
from typing import Any

from django.core.exceptions import PermissionDenied, RequestDataTooBig, SuspiciousOperation
from django.http import Http404, HttpRequest, HttpResponse
from django.urls import URLPattern, re_path
from django.views.decorators.csrf import csrf_exempt
from ninja import NinjaAPI
from ninja.errors import AuthenticationError, HttpError, ValidationError

from rehab.boards import api as boards
from rehab.legacy import api as legacy
from rehab.people import api as people
from rehab.people.access import public
from rehab.people.web.api_base import Browser, PerPerson, Rejected, Token, check_roles
from rehab.sessions import api as sessions

api = NinjaAPI(
    title="GARRY",
    version="1",
    description="Patients, sessions, steps and boards of your clinic. docs/api.md has examples.",
    urls_namespace="api",
    auth=[Token(), Browser()],
    throttle=PerPerson(),
)
api.add_decorator(check_roles)
for room in (people, sessions, boards, legacy):
    api.add_router("", room.router)

log = logging.getLogger(__name__)

WORDS = "Give one line of text, without spaces around it."


def refuse(
    request: HttpRequest, status: int, message: str, fields: dict[str, str] | None = None
) -> HttpResponse:
    """Answer with a problem."""
    return api.create_response(request, {"message": message, "fields": fields or {}}, status=status)


@api.exception_handler(AuthenticationError)
def refuse_strangers(request: HttpRequest, problem: AuthenticationError) -> HttpResponse:
    """Say how to be known."""
    response = refuse(
        request,
        401,
        "Send the header 'Authorization: Bearer TOKEN'. A lead makes tokens in the admin.",
    )
    response["WWW-Authenticate"] = "Bearer"
    return response


@api.exception_handler(HttpError)
def refuse_calls(request: HttpRequest, problem: HttpError) -> HttpResponse:
    """Say what a call refused."""
    return refuse(request, problem.status_code, str(problem))


@api.exception_handler(Http404)
def find_nothing(request: HttpRequest, problem: Http404) -> HttpResponse:
    """Say nothing of other clinics."""
    return refuse(request, 404, "Your clinic has none. Check the id.")


@api.exception_handler(Rejected)
def reject(request: HttpRequest, problem: Rejected) -> HttpResponse:
    """Say what models and forms object to."""
    return refuse(request, 409, str(problem), problem.fields)


@api.exception_handler(ValidationError)
def reject_shape(request: HttpRequest, problem: ValidationError) -> HttpResponse:
    """Say what has the wrong shape, by the names that the caller knows."""
    fields: dict[str, str] = {}
    for error in problem.errors:
        place: list[Any] = list(error["loc"])
        # The first names are where it stood (body, query, path) and our parameter's.
        names = place[2:] if place[0] in ("body", "query") and len(place) > 2 else place[1:]
        words = WORDS if error["type"] == "string_pattern_mismatch" else error["msg"]
        fields[".".join(map(str, names))] = words
    told = "; ".join(f"{name}: {words}" for name, words in fields.items())
    return refuse(request, 422, f"Not understood. {told}", fields)


@api.exception_handler(PermissionDenied)
def refuse_people(request: HttpRequest, problem: PermissionDenied) -> HttpResponse:
    """Say what somebody may not do."""
    return refuse(request, 403, str(problem) or "This is for other roles.")


@api.exception_handler(SuspiciousOperation)
def refuse_suspects(request: HttpRequest, problem: SuspiciousOperation) -> HttpResponse:
    """Say what no honest program sends."""
    if isinstance(problem, RequestDataTooBig):
        return refuse(request, 413, "The body is too long. Send less at once.")
    return refuse(request, 400, "Not understood. Look at the address, the headers and the body.")


@api.exception_handler(Exception)
def fail(request: HttpRequest, problem: Exception) -> HttpResponse:
    """Say nothing of our own faults; the server's log has them."""
    log.error("A call of the API failed: %s", request.path, exc_info=problem)
    return refuse(request, 500, "The server failed. Try again, or tell who runs it.")


@public
@csrf_exempt
def find_no_call(request: HttpRequest) -> HttpResponse:
    """Answer at an address that no call has."""
    return refuse(request, 404, "There is no such call. /api/v1/docs lists all.")


def in_json(view: Callable[..., HttpResponse]) -> Callable[..., HttpResponse]:
    """Say in the API's own shape that there is nothing here, or no such method."""

    @public
    @wraps(view)
    def answered(request: HttpRequest, **names: Any) -> HttpResponse:
        try:
            response = view(request, **names)
        except Http404:  # of the root
            return find_no_call(request)
        if response.status_code != 405:
            return response
        allowed = ", ".join(sorted(response["Allow"].split(", ")))  # it came from a set
        refused = refuse(request, 405, f"This address takes {allowed}. /api/v1/docs says more.")
        refused["Allow"] = allowed
        return refused

    return answered


def urls() -> list[URLPattern]:
    """Give the API's addresses. They guard themselves, so as to refuse in JSON."""
    patterns: list[Any] = api.urls[0]
    for pattern in patterns:
        pattern.callback = in_json(pattern.callback)
    return [*patterns, re_path("", find_no_call, name="no-call")]
