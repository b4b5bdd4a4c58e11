"""What a patient sees when a session has ended, before the scores, and what is taken home."""

from __future__ import annotations

from datetime import timedelta

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from rehab.patients.visits import next_visit
from rehab.people.access import actor_of, for_roles, user_of
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import clinic_time, format_duration
from rehab.sessions.log import RobotEntry
from rehab.sessions.models import TrainingSession
from rehab.sessions.pages.questions import page_after
from rehab.sessions.reports.patient_summary import describe_ending, describe_take_home
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


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_take_home(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show in plain words what a patient has walked; a person's simulated sessions do not count."""
    user = user_of(request)
    patient = get_object_or_404(
        Patient.objects.visible_to(user).select_related("clinic"), pk=patient_id
    )
    activate_patient_language(patient)
    sessions = TrainingSession.objects.visible_to(user).filter(
        patient=patient, simulated=patient.simulated
    )
    now = clinic_time(timezone.now(), patient.clinic)
    summary = describe_take_home(sessions, now)
    if patient.blinded:  # points, hits and how they went tell the arm
        summary |= {"bars": [], "development": "", "last_hits": None, "streak": ""}
    context = {
        "patient": patient,
        "summary": summary,
        "today": now.date(),
        "visit": None if patient.ended_at else next_visit(patient.pk, now),
    }
    return render(request, "sessions/takehome.html", context)
