"""The front page and the health check."""

from django.conf import settings
from django.db import connection
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from rehab.people.access import public
from rehab.training.valences import VALENCES


@public
@require_safe
def home(request: HttpRequest) -> HttpResponse:
    """Show the front page."""
    return render(
        request, "people/home.html", {"hosted": settings.HOSTED, "valences": VALENCES.values()}
    )


@public
@never_cache
@require_safe
def healthz(request: HttpRequest) -> HttpResponse:
    """Answer with "ok" while the server reaches its database."""
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    return HttpResponse("ok\n", content_type="text/plain")
