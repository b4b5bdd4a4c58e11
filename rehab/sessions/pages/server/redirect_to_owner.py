"""Requests that change something of a clinic: answered where the clinic lives.

Another server redirects the request, unchanged (307), to the same address: a cookie names the
clinic's server to the proxy, or the query where a program calls the API. Pages that only show
something read the database, at any server.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from django.http import HttpRequest, HttpResponse, HttpResponseBase

from rehab.people.models import User
from rehab.people.web.api_base import caller
from rehab.sessions.live import runtime
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from robot.wire.limits import SERVER_COOKIE, SERVER_HEADER

SAFE = ("GET", "HEAD", "OPTIONS")


def find_elsewhere(request: HttpRequest, user: Any) -> OwnedElsewhere | None:
    """Return which other server a person's request is for, where it may change something."""
    clinic_id = user.clinic_id if isinstance(user, User) else None
    live = runtime.peek()
    if clinic_id is None or request.method in SAFE or live is None or live.servers is None:
        return None
    return None if clinic_id in live.clinics else clinic_owners.find_elsewhere(clinic_id)


def is_named(request: HttpRequest, server: str) -> bool:
    """Return whether a request names this server to the proxy, which then does not reach it."""
    named = request.GET.get(SERVER_COOKIE) or request.headers.get(SERVER_HEADER)
    return server in ("", named or request.COOKIES.get(SERVER_COOKIE))


def redirect_call(request: HttpRequest, server: str) -> tuple[int, str]:
    """Return how a call of the API is answered whose clinic lives elsewhere: status and address.

    Parameters
    ----------
    request, server
        The call; the name of the clinic's server, empty while a command has the clinic.
    """
    if not server:
        return 409, ""
    if is_named(request, server):
        return 503, ""
    query = request.GET.copy()
    query[SERVER_COOKIE] = server
    return 307, f"{request.path}?{query.urlencode()}"


class ClinicServerMiddleware:
    """Sends the forms of a clinic's people to the clinic's server. Sync; it keeps no state."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on."""
        return self.get_response(request)

    def process_view(self, request: HttpRequest, *_: Any) -> HttpResponseBase | None:
        """Let the view run, or send the request away."""
        if (problem := find_elsewhere(request, request.user)) is None:
            return None
        headers = {"Cache-Control": "no-store"}
        if is_named(request, problem.server):
            headers["Retry-After"] = "1"
            return HttpResponse(f"{problem}\n", "text/plain", 503, headers=headers)
        headers["Location"] = request.get_full_path()
        response = HttpResponse(f"{problem}\n", "text/plain", 307, headers=headers)
        response.set_cookie(
            SERVER_COOKIE, problem.server, secure=request.is_secure(), samesite="Strict"
        )
        return response


def at_clinics_server(call: Callable[..., Any]) -> Callable[..., Any]:
    """Let a call of the API run where the caller's clinic lives. Raises OwnedElsewhere."""

    @wraps(call)
    def checked(request: HttpRequest, **values: Any) -> Any:
        if (problem := find_elsewhere(request, caller(request))) is not None:
            raise problem
        return call(request, **values)

    return checked
