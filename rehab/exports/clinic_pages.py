"""Buttons of a host: a clinic is taken out, verified and removed, as by `manage.py clinic`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_http_methods, require_safe

from rehab.exports.archive import StreamedResponse
from rehab.exports.clinic.clinic_removal import make_receipt
from rehab.exports.clinic.job import Job
from rehab.exports.forms import ClinicExportForm, ClinicRemovalForm
from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import Clinic
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up

READ_BYTES = 256 * 1024
REFRESH_S = 3


@for_roles(Role.HOST, patients=False)  # audited here
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def move_clinic(request: HttpRequest, clinic_id: int) -> HttpResponse:
    """Show what a clinic's latest subcommand said, with buttons for the next one; start that."""
    user, job = user_of(request), Job(clinic_id)
    clinic = Clinic.objects.visible_to(user).filter(pk=clinic_id).first()
    if clinic is None and not job.certificate.exists():
        raise Http404
    part = request.POST.get("part", "")
    export = ClinicExportForm(request.POST if part == "export" else None)
    removal = ClinicRemovalForm(request.POST if part == "remove" else None)
    if clinic is not None and not job.is_running:
        arguments: list[str] = []
        if export.is_valid():
            keys = [f"--to={key}" for key in export.cleaned_data["keys"].split()]
            tokens = ["--tokens"] if export.cleaned_data["tokens"] else []
            arguments = [*keys, *tokens, "--", clinic.name, str(job.file)]
        elif removal.is_valid():
            chosen = [f"--receipt={removal.cleaned_data['receipt']}", f"--by={user.username}"]
            arguments = [*chosen, "--", clinic.name, str(job.certificate)]
        elif part == "verify":
            arguments = ["--", clinic.name]
        if arguments:
            _record(request, clinic_id, f"{request.path}: {part}")
            job.start(part, *arguments)
            return redirect(request.path)
    moved = clinic and clinic.moves.order_by("number").last()
    context = {
        "clinic": clinic,
        "clinic_id": clinic_id,
        "job": job,
        "export": export,
        "removal": removal,
        "receipt": moved and make_receipt(moved.digests),
    }
    response = render(request, "exports/clinic.html", context)
    if job.is_running:
        response["Refresh"] = str(REFRESH_S)
    return response


@for_roles(Role.HOST, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_safe
def download_clinic(request: HttpRequest, clinic_id: int) -> HttpResponse:
    """Return the sealed file of a clinic."""
    return _send(request, clinic_id, Job(clinic_id).file)


@for_roles(Role.HOST, patients=False)
@step_up.required_for_download
@require_safe
def download_certificate(request: HttpRequest, clinic_id: int) -> HttpResponse:
    """Return the certificate of what is gone of a clinic."""
    return _send(request, clinic_id, Job(clinic_id).certificate)


def _send(request: HttpRequest, clinic_id: int, path: Path) -> HttpResponse:
    if not path.is_file():
        raise Http404
    _record(request, clinic_id, request.path)
    name = f"garry-clinic-{clinic_id}{path.suffix}"
    headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}
    return StreamedResponse(  # type: ignore[return-value]  # its body is streamed
        _read(path), content_type="application/octet-stream", headers=headers
    )


def _read(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while part := file.read(READ_BYTES):
            yield part


def _record(request: HttpRequest, clinic_id: int, about: str) -> None:
    """Record what a host does; where that fails, it is not done."""
    known = Clinic.objects.visible_to(user_of(request)).filter(pk=clinic_id).exists()
    audit_log.record(
        Act.EXPORT,
        user_of(request),
        clinic_id=clinic_id if known else None,
        about=about,
        address=client_address(request),
        now=timezone.now(),
    )
