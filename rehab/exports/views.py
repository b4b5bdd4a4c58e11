"""Consent and data of one patient: what is kept, given out, ended and erased."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_GET, require_POST, require_safe

from rehab.exports.archive import ZipResponse
from rehab.exports.forms import EndingForm, ErasingForm
from rehab.exports.patient_data import patient_files, session_files
from rehab.people import audit
from rehab.people.access import for_roles, person
from rehab.people.audit import Act
from rehab.people.consent import holding
from rehab.people.lockout import client_address
from rehab.people.models import Ending, Erasing, Patient, User
from rehab.people.roles import Role
from rehab.sessions.endings import StillOpen, end_program, erase, reopen_program
from rehab.sessions.models import TrainingSession


def find_patient(user: User, patient_id: int) -> Patient:
    """Give a patient that somebody sees. Raises Http404 for any other."""
    patients = Patient.objects.visible_to(user).select_related("clinic")
    return get_object_or_404(patients, pk=patient_id)


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_records(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show what can be done with all that is kept of a patient."""
    patient = find_patient(person(request), patient_id)
    return render_records(request, patient)


def render_records(request: HttpRequest, patient: Patient, **forms: Any) -> HttpResponse:
    """Give the page, with the forms as they were sent."""
    user = person(request)
    sessions = TrainingSession.objects.visible_to(user).filter(patient=patient)
    context = {
        "patient": patient,
        "held": list(holding(patient).values()),
        "count": sessions.count(),
        "may_erase": user.role == Role.LEAD,
        "ending": EndingForm(),
        "erasing": ErasingForm(patient=patient),
        **forms,
    }
    return render(request, "exports/records.html", context)


@for_roles(Role.LEAD, Role.PT, patients=False)  # noted here, before the first byte
@require_GET
def give_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Give all that is kept of one patient as a file."""
    user, now = person(request), timezone.now()
    patient = find_patient(user, patient_id)
    note_export(request, now, patient)
    name = f"garry-{patient.pseudonym}-{now:%Y-%m-%d}.zip"
    return _send(patient_files(user, patient, now), name, now)


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)
@require_safe
def show_export(request: HttpRequest) -> HttpResponse:
    """Say what the export of all sessions holds."""
    user = person(request)
    sessions = TrainingSession.objects.visible_to(user)
    context = {
        "sessions": sessions.count(),
        "patients": sessions.order_by().values("patient").distinct().count(),
        "needs_consent": user.clinic and user.clinic.research_needs_consent,
    }
    return render(request, "exports/export.html", context)


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)  # noted here, before the first byte
@require_GET
def give_sessions(request: HttpRequest) -> HttpResponse:
    """Give all sessions that somebody may see, by pseudonyms."""
    user, now = person(request), timezone.now()
    note_export(request, now)
    return _send(session_files(user, now), f"garry-sessions-{now:%Y-%m-%d}.zip", now)


def note_export(request: HttpRequest, now: datetime, patient: Patient | None = None) -> None:
    """Tell the audit log. Where it cannot be kept, nothing is given out."""
    audit.note(
        Act.EXPORT,
        person(request),
        patient=None if patient is None else patient.pk,
        about=request.path,
        address=client_address(request),
        now=now,
    )


def _send(files: Any, name: str, now: Any) -> HttpResponse:
    return ZipResponse(files, name, now)  # type: ignore[return-value]  # its body comes bit by bit


@for_roles(Role.LEAD, Role.PT)
@require_POST
def end(request: HttpRequest, patient_id: int) -> HttpResponse:
    """End a patient's program: off the lists, with the summary to take home."""
    patient = find_patient(person(request), patient_id)
    form = EndingForm(request.POST)
    if not form.is_valid():
        return render_records(request, patient, ending=form)
    try:
        end_program(patient, Ending(form.cleaned_data["because"]), timezone.now())
    except StillOpen as problem:
        form.add_error(None, str(problem))
        return render_records(request, patient, ending=form)
    said = _("%(patient)s's program has ended. Give the summary along.")
    messages.success(request, said % {"patient": patient.nickname})
    return redirect("patient", patient_id=patient.pk)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def reopen(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Take a patient back in."""
    patient = find_patient(person(request), patient_id)
    reopen_program(patient)
    return redirect("patient", patient_id=patient.pk)


@for_roles(Role.LEAD, patients=False)  # what is noted must not name whom it erases
@require_POST
def erase_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Erase all that leads to a person, once the code has been typed."""
    user = person(request)
    patient = find_patient(user, patient_id)
    form = ErasingForm(request.POST, patient=patient)
    if patient.erased_at is not None or not form.is_valid():
        return render_records(request, patient, erasing=form)
    try:
        erase(patient, Erasing(form.cleaned_data["because"]), user, timezone.now())
    except StillOpen as problem:
        form.add_error(None, str(problem))
        return render_records(request, patient, erasing=form)
    messages.success(request, _("All that led to this person is erased, for good."))
    return redirect("start")
