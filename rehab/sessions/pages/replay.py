"""The live room of a session, played again from its log."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.consent.services import is_remote_view_allowed
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.sessions.control_text import chart_marks
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.pages.monitor import redirect_to_consent
from rehab.sessions.reports.replay import play_back, start_of
from rehab.sessions.reports.review import review_session


@for_roles(Role.LEAD, Role.PT)
@gzip_page
@require_safe
def show_replay(request: HttpRequest, session_id: int) -> HttpResponse:
    """Play a session again: strides, notes, robot and the patient's page together.

    ``?at=`` is a moment, in seconds from the start; ``#stride-…`` a stride by its number.
    """
    user = user_of(request)
    sessions = TrainingSession.objects.visible_to(user).filter(legacy_id=None)
    session = get_object_or_404(
        sessions.select_related("patient__clinic", "clinic", "station", "measure"), pk=session_id
    )
    if not is_remote_view_allowed(session.patient, client_address(request)):
        return redirect_to_consent(request, session.patient)
    began = start_of(session)
    context = {
        "session": session,
        "began": clinic_time(began, session.clinic),
        "played": play_back(user, session),
        "chart_marks": chart_marks(),
        "events": [
            (at_s, f"{int(at_s) // 60}:{int(at_s) % 60:02d}", entry.text)
            for entry in review_session(user, session).events
            for at_s in [max(0.0, (entry.event.at - began).total_seconds())]
        ],
    }
    return render(request, "sessions/replay.html", context)
