"""A session's report, to be read and printed."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role, may_see_names
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.report import report_context


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
@require_safe
def show_report(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show one session's report for the records; researchers see a pseudonym."""
    user = user_of(request)
    sessions = TrainingSession.objects.visible_to(user).select_related(
        "patient", "clinic", "measure", "station", "created_by"
    )
    session = get_object_or_404(sessions, pk=session_id)
    context = {
        "session": session,
        "by_name": may_see_names(user.role),
        "began": clinic_time(session.began_at, session.clinic),
        "now": clinic_time(timezone.now(), session.clinic),
        "report": report_context(user, session),
    }
    return render(request, "sessions/report.html", context)
