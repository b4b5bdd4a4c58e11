"""The API: the calls of all rooms, and how errors are answered."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache, wraps
from typing import Any

from django.conf import settings
from django.contrib.auth.views import redirect_to_login
from django.core.exceptions import PermissionDenied, RequestDataTooBig, SuspiciousOperation
from django.http import Http404, HttpRequest, HttpResponse
from django.http.multipartparser import MultiPartParserError
from django.urls import URLPattern, re_path
from django.views.decorators.csrf import csrf_exempt
from ninja import NinjaAPI
from ninja.errors import AuthenticationError, HttpError, ValidationError
from ninja.openapi.schema import OpenAPISchema, get_schema

from rehab.boards import api as boards
from rehab.exports.fhir import api as fhir
from rehab.legacy import api as legacy
from rehab.people import api as people
from rehab.people.access import public
from rehab.people.models import User
from rehab.people.web.api_base import PerUserThrottle, Rejected, SessionAuth, TokenAuth, check_roles
from rehab.sessions import api as sessions
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.pages.server.redirect_to_owner import at_clinics_server, redirect_call


class Api(NinjaAPI):
    """The API; its description is built once, since that takes a fifth of a second."""

    def get_openapi_schema(
        self, *, path_prefix: str | None = None, path_params: dict[str, Any] | None = None
    ) -> OpenAPISchema:
        """Return the description of all calls under a prefix."""
        return describe(self, path_prefix or self.get_root_path(path_params or {}))


@cache
def describe(api: NinjaAPI, path_prefix: str) -> OpenAPISchema:
    """Return the description of an API's calls under a prefix."""
    return get_schema(api, path_prefix)


def for_members(view: Callable[..., HttpResponse]) -> Callable[..., HttpResponse]:
    """Show the description of the calls to strangers on one machine alone, not hosted."""

    @wraps(view)
    def shown(request: HttpRequest, **names: Any) -> HttpResponse:
        if not settings.HOSTED or isinstance(request.user, User) or TokenAuth()(request):
            return view(request, **names)
        if request.resolver_match and request.resolver_match.url_name == "openapi-view":
            return redirect_to_login(request.get_full_path())
        raise AuthenticationError

    return shown


api = Api(
    title="GARRY",
    version="1",
    description="Patients, sessions, steps and boards of your clinic. /help/api/ has examples.",
    urls_namespace="api",
    auth=[TokenAuth(), SessionAuth()],
    throttle=PerUserThrottle(),
    docs_decorator=for_members,
)
api.add_decorator(check_roles)
api.add_decorator(at_clinics_server)
for room in (people, sessions, boards, fhir, legacy):
    api.add_router("", room.router)

log = logging.getLogger(__name__)

TEXT_LINE_HINT = "Write one line of text, without spaces around it."


def problem_response(
    request: HttpRequest, status: int, message: str, fields: dict[str, str] | None = None
) -> HttpResponse:
    """Return a response with a `Problem`."""
    return api.create_response(request, {"message": message, "fields": fields or {}}, status=status)


@api.exception_handler(AuthenticationError)
def on_unauthenticated(request: HttpRequest, problem: AuthenticationError) -> HttpResponse:
    """Answer a stranger: how to authenticate."""
    response = problem_response(
        request,
        401,
        "Send the header 'Authorization: Bearer TOKEN'. A lead makes tokens in the admin.",
    )
    response["WWW-Authenticate"] = "Bearer"
    return response


@api.exception_handler(HttpError)
def on_http_error(request: HttpRequest, problem: HttpError) -> HttpResponse:
    """Answer with what a call refused."""
    return problem_response(request, problem.status_code, str(problem))


@api.exception_handler(OwnedElsewhere)
def on_owned_elsewhere(request: HttpRequest, problem: OwnedElsewhere) -> HttpResponse:
    """Send a call to the server that has the clinic."""
    status, address = redirect_call(request, problem.server)
    response = problem_response(request, status, str(problem))
    if address:
        response["Location"] = address
    return response


@api.exception_handler(Http404)
def on_not_found(request: HttpRequest, problem: Http404) -> HttpResponse:
    """Answer a missing row; it may be another clinic's."""
    return problem_response(request, 404, "Your clinic has none. Check the id.")


@api.exception_handler(Rejected)
def on_rejected(request: HttpRequest, problem: Rejected) -> HttpResponse:
    """Answer with the errors of models and forms."""
    return problem_response(request, 409, str(problem), problem.fields)


@api.exception_handler(ValidationError)
def on_validation_error(request: HttpRequest, problem: ValidationError) -> HttpResponse:
    """Answer with the schema's errors, by the names that the caller sent."""
    fields: dict[str, str] = {}
    for error in problem.errors:
        location: list[Any] = list(error["loc"])
        # The first items are the location (body, query, path) and the name of our parameter.
        names = location[1:]
        if location[0] in ("body", "query") and len(location) > 2:
            names = location[2:]
        text = TEXT_LINE_HINT if error["type"] == "string_pattern_mismatch" else error["msg"]
        fields[".".join(map(str, names))] = text
    details = "; ".join(f"{name}: {text}" for name, text in fields.items())
    return problem_response(request, 422, f"Not understood. {details}", fields)


@api.exception_handler(PermissionDenied)
def on_permission_denied(request: HttpRequest, problem: PermissionDenied) -> HttpResponse:
    """Answer with what the caller may not do."""
    return problem_response(request, 403, str(problem) or "This is for other roles.")


@api.exception_handler(MultiPartParserError)
@api.exception_handler(SuspiciousOperation)
def on_suspicious_operation(request: HttpRequest, problem: Exception) -> HttpResponse:
    """Answer a request that Django refuses as suspicious."""
    if isinstance(problem, RequestDataTooBig):
        return problem_response(request, 413, "The body is too long. Send less at once.")
    return problem_response(
        request, 400, "Not understood. Look at the address, the headers and the body."
    )


@api.exception_handler(Exception)
def on_server_error(request: HttpRequest, problem: Exception) -> HttpResponse:
    """Log an error of ours, and answer without its details."""
    log.error("A call of the API failed: %s", request.path, exc_info=problem)
    return problem_response(
        request, 500, "The server failed. Try again, or report it to its administrator."
    )


@public
@csrf_exempt
def unknown_call(request: HttpRequest) -> HttpResponse:
    """Answer at a URL without a call."""
    return problem_response(request, 404, "There is no such call. /api/v1/docs lists all.")


def with_json_errors(view: Callable[..., HttpResponse]) -> Callable[..., HttpResponse]:
    """Answer 404 and 405 of a view as JSON."""

    @public
    @wraps(view)
    def wrapped(request: HttpRequest, **names: Any) -> HttpResponse:
        try:
            response = view(request, **names)
        except Http404:  # of the API's root
            return unknown_call(request)
        except AuthenticationError as problem:  # of its description
            return on_unauthenticated(request, problem)
        if response.status_code != 405:
            return response
        allowed = ", ".join(sorted(response["Allow"].split(", ")))  # a set: sort it
        response = problem_response(
            request, 405, f"This address takes {allowed}. /api/v1/docs says more."
        )
        response["Allow"] = allowed
        return response

    return wrapped


def urls() -> list[URLPattern]:
    """Return the API's URLs. They check access themselves, to answer in JSON."""
    patterns: list[Any] = api.urls[0]
    for pattern in patterns:
        pattern.callback = with_json_errors(pattern.callback)
    return [*patterns, re_path("", unknown_call, name="no-call")]
