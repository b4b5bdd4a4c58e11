"""What a patient takes home on paper: the way so far, in plain words."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.patients.visits import next_visit
from rehab.people.access import for_roles, user_of
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.patient_summary import describe_take_home


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
    return render(request, "patients/take_home.html", context)
