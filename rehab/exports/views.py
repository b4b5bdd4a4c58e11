"""Consent and data of one patient: what is kept, given out, ended and erased."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_GET, require_safe

from rehab.exports.archive import ZipResponse
from rehab.exports.patient_data import patient_files, session_files
from rehab.patients.pages.records import get_patient
from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import Patient
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession


@for_roles(Role.LEAD, Role.PT, patients=False)  # noted here, before the first byte
@require_GET
def give_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Give all that is kept of one patient as a file."""
    user, now = user_of(request), timezone.now()
    patient = get_patient(user, patient_id)
    note_export(request, now, patient)
    name = f"garry-{patient.pseudonym}-{now:%Y-%m-%d}.zip"
    return _send(patient_files(user, patient, now), name)


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)
@require_safe
def show_export(request: HttpRequest) -> HttpResponse:
    """Say what the export of all sessions holds."""
    user = user_of(request)
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
    user, now = user_of(request), timezone.now()
    note_export(request, now)
    return _send(session_files(user, now), f"garry-sessions-{now:%Y-%m-%d}.zip")


def note_export(request: HttpRequest, now: datetime, patient: Patient | None = None) -> None:
    """Tell the audit log. Where it cannot be kept, nothing is given out."""
    audit_log.record(
        Act.EXPORT,
        user_of(request),
        patient=None if patient is None else patient.pk,
        about=request.path,
        address=client_address(request),
        now=now,
    )


def _send(files: Any, name: str) -> HttpResponse:
    return ZipResponse(files, name)  # type: ignore[return-value]  # its body comes bit by bit
