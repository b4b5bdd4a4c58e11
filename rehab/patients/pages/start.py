"""Where a session begins: who walks today, and what is open or past."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from django.contrib import messages
from django.db.models import Count, Max, Q, QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.patients.forms import PatientForm, ScreenForm
from rehab.patients.visits import SOON_DAYS, Visit, read_today, usual_time
from rehab.people.access import clinic_of, for_roles, person
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.formatting import at_clinic
from rehab.sessions.forms import SessionForm, like_last_time
from rehab.sessions.models import TrainingSession
from rehab.stations.builtin import first_station
from rehab.training.changes import OPEN_STATES

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
    states = [state.value for state in OPEN_STATES]
    return (
        TrainingSession.objects.visible_to(user)
        .filter(state__in=states)
        .select_related("patient", "station")
    )


def list_everybody(user: User, words: str = "") -> dict[str, Any]:
    """Give both lists of the start page: who is expected today, and all patients."""
    now = at_clinic(timezone.now(), clinic_of(user))
    patients = patients_of(user)
    if words:
        patients = patients.filter(Q(nickname__icontains=words) | Q(code__icontains=words))
    else:  # whose program has ended is found by name or code
        patients = patients.filter(ended_at=None)
    shown = list(patients[: SHOWN + 1])
    return {
        "now": now,
        "today": read_today(user, now),
        "patients": shown[:SHOWN],
        "more": len(shown) > SHOWN,
        "open": open_sessions(user),
    }


@for_roles(Role.LEAD, Role.PT)
@never_cache  # going back shows what is true now
@require_safe
def choose_patient(request: HttpRequest) -> HttpResponse:
    """List who is expected today, then all patients."""
    words = request.GET.get("q", "").strip()
    context = list_everybody(person(request), words) | {"q": words}
    return render(request, "patients/start.html", context)


@for_roles(Role.LEAD, Role.PT)
@never_cache
@require_safe
def show_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Offer a patient the session like last time, another one, the past ones, the next visit."""
    user = person(request)
    patient = get_object_or_404(patients_of(user), pk=patient_id)
    first_station(patient.clinic)
    initial = like_last_time(patient, user)
    lists = list_everybody(user)
    today = lists["now"].date()
    visits = Visit.objects.visible_to(user).filter(patient=patient, day__gte=today)
    context = lists | {
        "patient": patient,
        "open_here": open_sessions(user).filter(patient=patient),
        "form": SessionForm(initial=initial, patient=patient, by=user),
        "last": initial,
        "visits": visits,
        "soon": [
            (days, today + timedelta(days=days))
            for days in SOON_DAYS
            if days or all(row.patient != patient for row in lists["today"])
        ],
        "at": usual_time(user, patient, lists["now"]),
    }
    return render(request, "patients/start.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def add_patient(request: HttpRequest) -> HttpResponse:
    """Take a new patient in."""
    user = person(request)
    form = PatientForm(request.POST or None, by=user, now=timezone.now())
    if request.method == "POST" and form.keep():
        return redirect("setup", patient_id=form.instance.pk)
    return render(request, "patients/form.html", {"form": form})


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def mend_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Mend what was written of a patient."""
    user = person(request)
    patient = get_object_or_404(patients_of(user), pk=patient_id)
    form = PatientForm(request.POST or None, by=user, now=timezone.now(), instance=patient)
    if request.method == "POST" and form.keep():
        return redirect("patient", patient_id=patient.pk)
    context = {"form": form, "patient": Patient.objects.visible_to(user).get(pk=patient_id)}
    return render(request, "patients/form.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def set_screen(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Fit the patient's page to this patient's eyes and ears."""
    patient = get_object_or_404(patients_of(person(request)), pk=patient_id)
    form = ScreenForm(request.POST or None, instance=patient)
    if request.method == "POST" and form.keep():
        return redirect("patient", patient_id=patient.pk)
    return render(request, "patients/screen_form.html", {"form": form, "patient": patient})


@for_roles(Role.LEAD, Role.PT)
@require_POST
def add_demo(request: HttpRequest) -> HttpResponse:
    """Let somebody who only looks around begin with a simulated patient."""
    user = person(request)
    patient, _made = Patient.objects.visible_to(user).get_or_create(
        clinic=clinic_of(user),
        code=DEMO_CODE,
        defaults={"nickname": "Demo", "paretic_side": "left", "simulated": True},
    )
    if not patient.simulated:
        said = _("%(nickname)s has the code %(code)s. Give that patient another code first.")
        messages.error(request, said % {"nickname": patient.nickname, "code": patient.code})
    return redirect("patient", patient_id=patient.pk)
