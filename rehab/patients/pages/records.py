"""A patient's records: stored data, end of the program, erasure."""

from __future__ import annotations

from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from rehab.patients.closure import SessionStillOpen, end_program, reopen_program
from rehab.patients.erasure import erase
from rehab.patients.family import NOT_AGREED, open_links, refusal_reason
from rehab.patients.forms import EndProgramForm, ErasureForm
from rehab.people.access import for_roles, get_patient, user_of
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import active_consents, answered_purposes, unasked_purposes
from rehab.people.models import EndReason, ErasureReason, Patient
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.sessions.models import TrainingSession


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_records(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show the page on consent, data and the end of the program."""
    patient = get_patient(user_of(request), patient_id)
    return render_records(request, patient)


def render_records(request: HttpRequest, patient: Patient, **forms: Any) -> HttpResponse:
    """Return the page, with the forms as they were sent."""
    user = user_of(request)
    sessions = TrainingSession.objects.visible_to(user).filter(patient=patient)
    given, answered = active_consents(patient), answered_purposes(patient)
    context = {
        "patient": patient,
        "consents": [each.label for each in Purpose if each in given],
        "refused": [each.label for each in Purpose if each in answered - given.keys()],
        "unasked": [] if patient.erased_at else [each.label for each in unasked_purposes(patient)],
        "family_refusal": refusal_reason(patient),
        "may_ask_family": refusal_reason(patient) == str(NOT_AGREED),
        "family_links": open_links(patient, timezone.now()).count(),
        "count": sessions.count(),
        "may_erase": user.role == Role.LEAD,
        "ending": EndProgramForm(),
        "erasing": ErasureForm(patient=patient),
        **forms,
    }
    return render(request, "patients/records.html", context)


@for_roles(Role.LEAD, Role.PT)
@step_up.required
@require_POST
def end_patient_program(request: HttpRequest, patient_id: int) -> HttpResponse:
    """End a patient's program, so that the patient is no longer listed."""
    patient = get_patient(user_of(request), patient_id)
    form = EndProgramForm(request.POST)
    if not form.is_valid():
        return render_records(request, patient, ending=form)
    try:
        reason = EndReason(form.cleaned_data["reason"])
        end_program(patient, reason, timezone.now(), user_of(request))
    except SessionStillOpen as problem:
        form.add_error(None, str(problem))
        return render_records(request, patient, ending=form)
    message = _("%(patient)s's program has ended. Hand over the summary.")
    messages.success(request, message % {"patient": patient.nickname})
    return redirect("patient", patient_id=patient.pk)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def reopen_patient_program(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Reopen a patient's program."""
    patient = get_patient(user_of(request), patient_id)
    reopen_program(patient)
    return redirect("patient", patient_id=patient.pk)


@for_roles(Role.LEAD, patients=False)  # the audit entry must not name the erased patient
@step_up.required
@require_POST
def erase_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Erase everything that identifies a person, after the code was typed as confirmation."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    form = ErasureForm(request.POST, patient=patient)
    if patient.erased_at is not None or not form.is_valid():
        return render_records(request, patient, erasing=form)
    try:
        erase(patient, ErasureReason(form.cleaned_data["reason"]), user, timezone.now())
    except SessionStillOpen as problem:
        form.add_error(None, str(problem))
        return render_records(request, patient, erasing=form)
    messages.success(request, _("All data that identified this person are erased, for good."))
    return redirect("start")
