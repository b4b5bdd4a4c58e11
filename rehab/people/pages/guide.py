"""The guide for therapists, of which each page opens its part."""

from __future__ import annotations

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles
from rehab.people.roles import Role
from rehab.people.web.help_pages import using_guide


@for_roles(*Role, patients=False)
@require_safe
def show_help(request: HttpRequest) -> HttpResponse:
    """Show docs/using.md."""
    guide = using_guide()
    if not guide:
        raise Http404
    return render(request, "people/help.html", {"guide": guide})
