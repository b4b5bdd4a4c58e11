"""Pages that export data: of one patient, or all sessions by pseudonyms."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

from django.conf import settings
from django.db.models import Max, Min
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext
from django.views.decorators.http import require_GET, require_POST, require_safe

from rehab.exports.archive import ZipResponse
from rehab.exports.export_files import patient_files, session_files
from rehab.exports.forms import ResearchExportForm
from rehab.exports.research.resumable_export import Package, discard_old
from rehab.outbox.models import Topic, notify
from rehab.people.access import for_roles, get_patient, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import Patient, User
from rehab.people.networks import client_address
from rehab.people.roles import PATIENT_EXPORTERS, SESSION_EXPORTERS
from rehab.people.sign_in import step_up
from rehab.people.web.csv_tables import CsvWriter
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.insight import read_view, to_table

SECONDS_OF_A_CALL = 1.5  # in which an export goes on; the page asks again and again


@for_roles(*PATIENT_EXPORTERS, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Return everything stored of one patient as a file."""
    user, now = user_of(request), timezone.now()
    patient = get_patient(user, patient_id)
    audit_export(request, now, patient)
    name = f"garry-{patient.pseudonym}-{now:%Y-%m-%d}.zip"
    return _stream(patient_files(user, patient, now), name)


@for_roles(*SESSION_EXPORTERS, patients=False)
@step_up.required
@require_safe
def show_export(request: HttpRequest) -> HttpResponse:
    """Show what the export of all sessions contains."""
    user = user_of(request)
    sessions = TrainingSession.objects.visible_to(user)
    folder, now = research_folder(user), timezone.now()
    discard_old(folder.parent, now)
    package = Package.find(folder, user, now)
    context = {
        "form": ResearchExportForm(by=user),
        "package": package,
        "progress": package and package.progress,
        "sessions": sessions.count(),
        "patients": sessions.order_by().values("patient").distinct().count(),
        **sessions.order_by().aggregate(first=Min("created_at"), last=Max("created_at")),
        "needs_consent": user.clinic and user.clinic.research_needs_consent,
    }
    return render(request, "exports/export.html", context)


@for_roles(*SESSION_EXPORTERS, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_sessions(request: HttpRequest) -> HttpResponse:
    """Return all sessions that the user may see as a file, by pseudonyms."""
    user, now = user_of(request), timezone.now()
    audit_export(request, now)
    return _stream(session_files(user, now), f"garry-sessions-{now:%Y-%m-%d}.zip")


def research_folder(user: User) -> Path:
    """Return where an account's export for analysis is made; an account has one at a time."""
    return Path(settings.DATA_DIR) / "exports" / str(user.pk)


@for_roles(*SESSION_EXPORTERS, patients=False)  # audited here, before the first file
@step_up.required
@require_POST
def prepare_research(request: HttpRequest) -> HttpResponse:
    """Begin an export for analysis, or remove the one that was begun."""
    user, now = user_of(request), timezone.now()
    form = ResearchExportForm(request.POST, by=user)
    if "discard" in request.POST:
        package = Package.find(research_folder(user), user, now)
        if package is not None:
            package.discard()
    elif form.is_valid():
        audit_export(request, now)
        chosen, shift = form.cleaned_data["study"], form.cleaned_data["shift_dates"]
        Package.create(research_folder(user), user, chosen, shift_dates=shift, now=now)
    return redirect("export")


@for_roles(*SESSION_EXPORTERS, patients=False)
@require_POST
def advance_research(request: HttpRequest) -> HttpResponse:
    """Write some more sessions of the export that was begun; return how far it is."""
    user = user_of(request)
    package = Package.find(research_folder(user), user, timezone.now())
    if package is None:
        return JsonResponse({"message": gettext("This export is not there any more.")}, status=404)
    reached = before = package.progress
    for reached in package.advance(SECONDS_OF_A_CALL):  # noqa: B007 - the last one is returned
        pass
    if reached.is_done and not before.is_done and user.clinic_id is not None:
        notify(user.clinic_id, Topic.EXPORT, {"sessions": reached.total}, timezone.now())
    return JsonResponse({"done": reached.done, "total": reached.total})


@for_roles(*SESSION_EXPORTERS, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_research(request: HttpRequest) -> HttpResponse:
    """Return the export for analysis, once all of it is written."""
    user, now = user_of(request), timezone.now()
    package = Package.find(research_folder(user), user, now)
    if package is None or not package.progress.is_done:
        return redirect("export")
    audit_export(request, now)
    name = f"garry-{package.study or 'sessions'}-{package.made_at:%Y-%m-%d}.zip"
    return _stream(package.files(), name)


@for_roles(*PATIENT_EXPORTERS, patients=False)  # audited here, before the first byte
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
    CsvWriter(response).write(to_table(view.shown))
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
