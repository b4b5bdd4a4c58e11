"""The page that a patient sees when a session has ended, before the scores."""

from __future__ import annotations

from datetime import timedelta

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from rehab.patients.visits import next_visit
from rehab.people.access import actor_of, for_roles
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import clinic_time, format_duration
from rehab.sessions.log import RobotEntry
from rehab.sessions.models import TrainingSession
from rehab.sessions.pages.questions import page_after
from rehab.sessions.reports.patient_summary import describe_ending
from rehab.stations.tablets import ENDING_STAYS_S
from rehab.training.changes import OPEN_STATES, State


@for_roles(Role.LEAD, Role.PT, tablets=True)
@never_cache
@require_safe
def show_ending(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show a session's end to its patient; an open one goes on walking."""
    actor = actor_of(request)
    sessions = TrainingSession.objects.visible_to(actor).select_related("patient__clinic")
    session = get_object_or_404(sessions, pk=session_id)
    activate_patient_language(session.patient)
    if State(session.state) in OPEN_STATES:
        return redirect("walk", session_id=session.pk)
    tablet = not request.user.is_authenticated
    tomorrow = clinic_time(timezone.now(), session.clinic) + timedelta(days=1)
    midnight = tomorrow.replace(hour=0, minute=0, second=0, microsecond=0)
    context = {
        "session": session,
        "tablet": tablet,
        "stays_s": ENDING_STAYS_S,
        "walked": format_duration(session.active_s),
        "visit": next_visit(session.patient_id, midnight),
        "after": page_after(session, actor, tablet=tablet),
        "with_robot": session.events.filter(kind=RobotEntry.GESTURE.value).exists(),
    } | describe_ending(session)
    return render(request, "patients/ending.html", context)
