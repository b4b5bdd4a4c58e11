"""The report of a robot's incident: on a page and paper, and as a file."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.views.decorators.http import require_GET, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import User
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.sessions.formatting import clinic_time
from rehab.sessions.reports.incident import review_incident
from rehab.sessions.robot_incidents import RobotIncident
from robot.wire.frames import BadFrame
from robot.wire.incident import to_lines


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_incident(request: HttpRequest, incident_id: int) -> HttpResponse:
    """Show what a robot did around a stop, with a replay."""
    incident = _find(user_of(request), incident_id)
    session = incident.session
    try:
        review = review_incident(incident.records())
    except BadFrame:
        review = None
    context = {
        "incident": incident,
        "session": session,
        "at": clinic_time(incident.at, session.clinic),
        "now": clinic_time(timezone.now(), session.clinic),
        "review": review,
    }
    return render(request, "sessions/incident.html", context)


@for_roles(Role.LEAD, Role.PT, patients=False)  # audited here, before the first byte
@step_up.required_for_download
@require_GET
def download_incident(request: HttpRequest, incident_id: int) -> HttpResponse:
    """Return the recording as a file, which `python -m robot replay` plays."""
    user, now = user_of(request), timezone.now()
    incident = _find(user, incident_id)
    audit_log.record(
        Act.EXPORT,
        user,
        patient_id=incident.session.patient_id,
        about=request.path,
        address=client_address(request),
        now=now,
    )
    try:
        text = to_lines(incident.records())
    except BadFrame:
        text = ""
    name = f"garry-robot-{incident.session_id}-{incident.pk}.jsonl"
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return HttpResponse(text, content_type="application/jsonl", headers=headers)


def _find(user: User, incident_id: int) -> RobotIncident:
    rows = RobotIncident.objects.visible_to(user).select_related(
        "session", "session__clinic", "session__station", "session__patient"
    )
    return get_object_or_404(rows, pk=incident_id)
