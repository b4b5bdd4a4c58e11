"""The pages that are printed: a session's report, and what a patient takes home."""

from __future__ import annotations

from django.db.models import Q
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.models import Patient
from rehab.people.roles import Role, may_see_names
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.patient_summary import describe_take_home
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
    later = Q(day__gt=now.date()) | Q(day=now.date(), at__gt=now.time())
    context = {
        "patient": patient,
        "summary": summary,
        "today": now.date(),
        "visit": None if patient.ended_at else patient.visits.filter(later).first(),
    }
    return render(request, "sessions/takehome.html", context)
