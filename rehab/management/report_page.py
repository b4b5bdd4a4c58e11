"""The file with which a problem is reported, for who answers for the whole server."""

from __future__ import annotations

from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from rehab.management.commands.doctor import diagnose, report_of
from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.people.web.help_pages import may_report


@for_roles(Role.HOST, Role.LEAD, patients=False)
@never_cache
@require_safe
def report_problem(request: HttpRequest) -> HttpResponse:
    """Return what `garry doctor --report` writes; all clinics' rows are counted in it."""
    if not may_report(user_of(request)):
        raise PermissionDenied
    now = timezone.now()
    text = report_of(diagnose(), now)
    return HttpResponse(
        text,
        content_type="text/plain; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="garry-{now:%Y-%m-%d}.txt"'},
    )
