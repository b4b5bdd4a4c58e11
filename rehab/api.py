"""Gathers the rooms' calls into one API, and says what is refused in one way."""

from __future__ import annotations

from typing import Any

from django.http import Http404, HttpRequest, HttpResponse
from ninja import NinjaAPI
from ninja.errors import AuthenticationError, HttpError, ValidationError

from rehab.boards import api as boards
from rehab.people import api as people
from rehab.people.access import public
from rehab.people.api_base import Browser, PerPerson, Rejected, Token, check_roles
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
for router in (people.router, sessions.router, boards.router, people.paper, sessions.paper):
    api.add_router("", router)

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


def urls() -> list[Any]:
    """Give the API's addresses. They guard themselves, so as to refuse in JSON."""
    patterns: list[Any] = api.urls[0]
    for pattern in patterns:
        public(pattern.callback)
    return patterns
