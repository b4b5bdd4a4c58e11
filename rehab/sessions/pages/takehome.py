"""A page on paper for the patient to take home."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, person
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.web.language import speak_to
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.takehome import sum_up_for_home


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_take_home(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Tell in plain words what a patient has walked; a person's figures hold no simulated ones."""
    user = person(request)
    patient = get_object_or_404(
        Patient.objects.visible_to(user).select_related("clinic"), pk=patient_id
    )
    speak_to(patient)
    sessions = TrainingSession.objects.visible_to(user).filter(
        patient=patient, simulated=patient.simulated
    )
    now = clinic_time(timezone.now(), patient.clinic)
    told = sum_up_for_home(user, sessions, now)
    context = {"patient": patient, "told": told, "today": now.date()}
    return render(request, "sessions/takehome.html", context)
