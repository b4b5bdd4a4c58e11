"""A session on one page of paper."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, person
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.report import moment_of, write_report


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
@require_safe
def show_report(request: HttpRequest, session_id: int) -> HttpResponse:
    """Write one session's page for the records; researchers see a pseudonym."""
    user = person(request)
    sessions = TrainingSession.objects.visible_to(user).select_related(
        "patient", "clinic", "measure", "station", "created_by"
    )
    session = get_object_or_404(sessions, pk=session_id)
    context = {
        "session": session,
        "by_name": user.role != Role.RESEARCHER,
        "began": moment_of(session),
        "now": clinic_time(timezone.now(), session.clinic),
        "report": write_report(user, session),
    }
    return render(request, "sessions/report.html", context)
