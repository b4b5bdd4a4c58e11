"""What a watchdog asks: is the server alive, does it store steps, may it get visitors."""

from django.db import connection
from django.http import HttpRequest, HttpResponse
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from rehab.people.access import public
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database import server_lease
from rehab.sessions.live.database.trouble import WORDS


@public
@never_cache
@require_safe
def healthz(request: HttpRequest) -> HttpResponse:
    """Answer with "ok" while the server reaches its database and stores steps; else say why not."""
    live = runtimes.peek()
    if live is not None and (trouble := live.writer.trouble):
        return _answer(WORDS[trouble], 503)
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    return _answer("ok", 200)


@public
@never_cache
@require_safe
def readyz(request: HttpRequest) -> HttpResponse:
    """Answer with "ok" once the sessions of the last run are back, and until the server stops."""
    problem = find_unready()
    return _answer(problem, 503) if problem else healthz(request)


def find_unready() -> str:
    """Return why the server may get no visitors, as far as it knows without asking; else ""."""
    live = runtimes.peek()
    if live is None or not live.is_ready:
        return "The server is starting or stopping."
    if live.servers is not None and live.servers.is_isolated:
        return "The server was cut off from its database, which another one has."
    if (own := server_lease.held()) is not None and not own.is_current:
        return "The server's lease has expired: the database does not answer."
    return ""


def _answer(words: str, status: int) -> HttpResponse:
    return HttpResponse(f"{words}\n", content_type="text/plain", status=status)
