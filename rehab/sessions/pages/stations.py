"""The clinic's stations: who walks there, their devices, and the robot's stop."""

from __future__ import annotations

from datetime import datetime

from django.contrib import messages
from django.db.models import Prefetch
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.audit.audit_log import Act, record
from rehab.people.networks import client_address
from rehab.people.roles import Right, Role, rights_of
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day.today import IS_OPEN
from rehab.sessions.services import stop_robot
from rehab.stations.builtin import first_station
from rehab.stations.device_trust import with_trust
from rehab.stations.models import Device, Station
from rehab.stations.presence import JUST_NOW, format_device_states


@for_roles(Role.LEAD, Role.PT)
@never_cache
@require_safe
def list_stations(request: HttpRequest) -> HttpResponse:
    """List the clinic's stations: who walks there, their devices, and how well each is heard."""
    user, now = user_of(request), timezone.now()
    first_station(clinic_of(user))
    devices = (
        with_trust(Device.objects.visible_to(user))
        .select_related("approver")
        .order_by("kind", "name")
    )
    sessions = TrainingSession.objects.visible_to(user).filter(IS_OPEN).select_related("patient")
    stations = Station.objects.visible_to(user).prefetch_related(
        Prefetch("devices", devices), Prefetch("sessions", sessions, to_attr="open_sessions")
    )
    context = {
        "lately": now - JUST_NOW,
        "may_edit": Right.CHANGE in rights_of(user.role, "Station"),
        "stations": [
            (one, format_device_states(list(one.devices.all()), now), _missing(one, now))
            for one in stations
        ],
    }
    return render(request, "stations/stations.html", context)


def _missing(station: Station, now: datetime) -> list[str] | None:
    """Return the kinds of device that a walk at a station would lack; None where it has no device.

    A walk needs a sensor and a tablet, and the robot where the station has one.
    """
    used = [one for one in station.devices.all() if not one.is_revoked]
    if not used:
        return None
    here = {one.kind for one in used if one.last_seen_at and now - one.last_seen_at < JUST_NOW}
    own = {one.kind for one in used if not one.builtin}
    lacks = (own | {Device.Kind.SOURCE, Device.Kind.TABLET}) - here
    return [str(kind.label).lower() for kind in Device.Kind if kind in lacks]


@for_roles(Role.LEAD, Role.PT)
@require_POST
def stop_robot_of(request: HttpRequest, session_id: int) -> HttpResponse:
    """Stop the robot of a session, whichever page the therapist is on."""
    user = user_of(request)
    rows = TrainingSession.objects.visible_to(user).select_related("station")
    session = get_object_or_404(rows.filter(IS_OPEN), pk=session_id)
    try:
        stop_robot(session, user)
    except (NotStored, OwnedElsewhere) as problem:
        messages.error(request, f"{problem} {_('To stop the robot, use its own switch.')}")
    else:
        record(
            Act.ROBOT_STOP,
            user,
            patient_id=session.patient_id,
            about=request.path,
            address=client_address(request),
            now=timezone.now(),
        )
        messages.success(request, _("Robot stopped: %(station)s.") % {"station": session.station})
    return redirect("stations")
