"""Pages that export data: of one patient, or all sessions by pseudonyms."""

from __future__ import annotations

import csv
from datetime import datetime
from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_GET, require_safe

from rehab.exports.archive import ZipResponse
from rehab.exports.patient_data import patient_files, session_files
from rehab.exports.tables import format_cells
from rehab.patients.pages.records import get_patient
from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import Patient
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.insight import read_view, to_table


@for_roles(Role.LEAD, Role.PT, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Return everything stored of one patient as a file."""
    user, now = user_of(request), timezone.now()
    patient = get_patient(user, patient_id)
    audit_export(request, now, patient)
    name = f"garry-{patient.pseudonym}-{now:%Y-%m-%d}.zip"
    return _stream(patient_files(user, patient, now), name)


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)
@step_up.required
@require_safe
def show_export(request: HttpRequest) -> HttpResponse:
    """Show what the export of all sessions contains."""
    user = user_of(request)
    sessions = TrainingSession.objects.visible_to(user)
    context = {
        "sessions": sessions.count(),
        "patients": sessions.order_by().values("patient").distinct().count(),
        "needs_consent": user.clinic and user.clinic.research_needs_consent,
    }
    return render(request, "exports/export.html", context)


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_sessions(request: HttpRequest) -> HttpResponse:
    """Return all sessions that the user may see as a file, by pseudonyms."""
    user, now = user_of(request), timezone.now()
    audit_export(request, now)
    return _stream(session_files(user, now), f"garry-sessions-{now:%Y-%m-%d}.zip")


@for_roles(Role.LEAD, Role.PT, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_insight(request: HttpRequest) -> HttpResponse:
    """Return the sessions that the insight page shows as a table, a session a line."""
    user, now = user_of(request), timezone.now()
    view = read_view(user, request.GET, now)
    audit_export(request, now)
    name = f"garry-insight-{now:%Y-%m-%d}.csv"
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    response = HttpResponse(content_type="text/csv; charset=utf-8", headers=headers)
    csv.writer(response, lineterminator="\r\n").writerows(format_cells(to_table(view.shown)))
    return response


def audit_export(request: HttpRequest, now: datetime, patient: Patient | None = None) -> None:
    """Record an export in the audit log; where that fails, nothing is exported."""
    audit_log.record(
        Act.EXPORT,
        user_of(request),
        patient_id=None if patient is None else patient.pk,
        about=request.path,
        address=client_address(request),
        now=now,
    )


def _stream(files: Any, name: str) -> HttpResponse:
    return ZipResponse(files, name)  # type: ignore[return-value]  # its body is streamed
