"""The front page."""

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
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
