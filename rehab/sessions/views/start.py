"""Where a session begins: who walks today, and what is open or past."""

from __future__ import annotations

from django.db.models import Count, Max, QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.people.access import clinic_of, for_roles, person
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.forms import PatientForm, ScreenForm, SessionForm, like_last_time
from rehab.sessions.models import TrainingSession
from rehab.stations.builtin import first_station
from rehab.training.changes import OPEN

SHOWN = 60  # patients on one page, those who were here last first
DEMO_CODE = "demo"


def patients_of(user: User) -> QuerySet[Patient]:
    """Give the patients of somebody's clinic, those who were here last first."""
    return (
        Patient.objects.visible_to(user)
        .annotate(last_here=Max("sessions__created_at"), count=Count("sessions"))
        .order_by("-last_here", "-created_at")
    )


def open_sessions(user: User) -> QuerySet[TrainingSession]:
    """Give the sessions that have begun, or could, and have not ended."""
    states = [state.value for state in OPEN]
    return (
        TrainingSession.objects.visible_to(user)
        .filter(state__in=states)
        .select_related("patient", "station")
    )


@for_roles(Role.LEAD, Role.PT)
@require_safe
def choose_patient(request: HttpRequest) -> HttpResponse:
    """List the patients."""
    user = person(request)
    words = request.GET.get("q", "").strip()
    patients = patients_of(user)
    if words:
        patients = patients.filter(nickname__icontains=words) | patients.filter(
            code__icontains=words
        )
    else:  # whose program has ended is found by name or code
        patients = patients.filter(ended_at=None)
    context = {"patients": patients[:SHOWN], "open": open_sessions(user), "q": words}
    return render(request, "sessions/start.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Offer a patient the session like last time, another one, or the past ones."""
    user = person(request)
    patient = get_object_or_404(patients_of(user), pk=patient_id)
    listed = patients_of(user).filter(ended_at=None)
    first_station(patient.clinic)
    initial = like_last_time(patient, user)
    context = {
        "patients": listed[:SHOWN],
        "patient": patient,
        "open": open_sessions(user),
        "open_here": open_sessions(user).filter(patient=patient),
        "form": SessionForm(initial=initial, patient=patient, by=user),
        "last": initial,
    }
    return render(request, "sessions/start.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def add_patient(request: HttpRequest) -> HttpResponse:
    """Take a new patient in."""
    user = person(request)
    form = PatientForm(request.POST or None, by=user)
    if request.method == "POST" and form.is_valid():
        return redirect("setup", patient_id=form.save().pk)
    return render(request, "sessions/patient_form.html", {"form": form})


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def mend_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Mend what was written of a patient."""
    user = person(request)
    patient = get_object_or_404(patients_of(user), pk=patient_id)
    form = PatientForm(request.POST or None, by=user, instance=patient)
    if request.method == "POST" and form.is_valid():
        form.save()
        return redirect("patient", patient_id=patient.pk)
    context = {"form": form, "patient": Patient.objects.visible_to(user).get(pk=patient_id)}
    return render(request, "sessions/patient_form.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def set_screen(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Fit the patient's page to this patient's eyes and ears."""
    patient = get_object_or_404(patients_of(person(request)), pk=patient_id)
    form = ScreenForm(request.POST or None, instance=patient)
    if request.method == "POST" and form.is_valid():
        form.save()
        return redirect("patient", patient_id=patient.pk)
    return render(request, "sessions/screen_form.html", {"form": form, "patient": patient})


@for_roles(Role.LEAD, Role.PT)
@require_POST
def add_demo(request: HttpRequest) -> HttpResponse:
    """Let somebody who only looks around begin with a simulated patient."""
    user = person(request)
    patient = Patient.objects.visible_to(user).filter(simulated=True, code=DEMO_CODE).first()
    if patient is None:
        patient = Patient(
            clinic=clinic_of(user),
            code=DEMO_CODE,
            nickname="Demo",
            paretic_side="left",
            simulated=True,
        )
        patient.save()
    return redirect("patient", patient_id=patient.pk)
