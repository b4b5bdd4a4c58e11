"""The front page, and the sign of life."""

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
    """Say what can be done here."""
    return render(
        request, "people/home.html", {"hosted": settings.HOSTED, "valences": VALENCES.values()}
    )


@public
@never_cache
@require_safe
def healthz(request: HttpRequest) -> HttpResponse:
    """Say that the server answers and reaches its database."""
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    return HttpResponse("ok\n", content_type="text/plain")
