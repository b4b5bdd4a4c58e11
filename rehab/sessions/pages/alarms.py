"""Alarms on the therapist's other pages, and the clinic's list of incidents."""

from __future__ import annotations

from datetime import datetime, timedelta

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.roles import Role
from rehab.people.simulated import counted, is_counted
from rehab.sessions.alarms import Alarm, falls_just_seen, open_alarms
from rehab.sessions.formatting import clinic_time
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.pages.history import PERIODS
from rehab.sessions.reports.incident_list import count_adverse, list_adverse
from rehab.sessions.services import acknowledge
from rehab.stations.models import Device
from rehab.training.changes import OPEN_STATES, State

MAX_INCIDENTS = 200
LONGEST = "52"  # weeks


@for_roles(Role.LEAD, Role.PT)
@never_cache
@require_safe
def show_alarms(request: HttpRequest) -> HttpResponse:
    """Return what is open in the clinic, or at one station, as a part of a page.

    Falls come first. A simulated session's robot is told of on that session's page alone.
    ``but``: of which open sessions the page itself tells: there, what others that ended left is
    folded up.
    """
    station = request.GET.get("station", "")
    user, now = user_of(request), timezone.now()
    found = open_alarms(user, now, int(station) if station.isdecimal() else None)
    but = request.GET.getlist("but")
    parts: dict[str, list[tuple[SessionEvent, datetime, bool]]] = {
        "falls": [],
        "stops": [],
        "ended": [],
    }
    for one in found:
        is_fall = one.kind == Alarm.FALL
        is_own, is_open = str(one.session_id) in but, State(one.session.state) in OPEN_STATES
        if (is_own and is_open) or not (is_fall or is_counted(one.session.simulated)):
            continue
        is_folded = bool(but) and not is_own and not is_open
        part = "ended" if is_folded else "falls" if is_fall else "stops"
        parts[part].append((one, clinic_time(one.at, one.session.clinic), is_open))
    stopped: list[int] = []
    if found:
        robots = Device.objects.visible_to(user).filter(kind=Device.Kind.ROBOT)
        stopped = list(robots.filter(station__robot_stopped=True).values_list("station", flat=True))
    seen = falls_just_seen(user, now) if not but else []
    told = [(one, clinic_time(one.at, one.session.clinic)) for one in seen]
    return render(request, "sessions/alarms.html", parts | {"seen": told, "stopped": stopped})


@for_roles(Role.LEAD, Role.PT)
@require_POST
def acknowledge_alarms(request: HttpRequest, session_id: int) -> HttpResponse:
    """Note that a therapist has seen a session's alarms of a ``kind``."""
    user, kind = user_of(request), request.POST.get("kind", "")
    session = get_object_or_404(TrainingSession.objects.visible_to(user), pk=session_id)
    if kind not in {one.value for one in Alarm}:
        return HttpResponse(_("Reload the page, then tap again."), status=400)
    try:
        acknowledge(session, Alarm(kind), user)
    except NotStored as problem:
        return HttpResponse(str(problem), status=503)
    return HttpResponse(status=204)


@for_roles(Role.LEAD, Role.PT)
@require_safe
def list_incidents(request: HttpRequest) -> HttpResponse:
    """List what went wrong: what was done then, how it ended, and who saw it when.

    ``?weeks=`` is how far back, a year unless it is one of ``PERIODS``.
    """
    user, now = user_of(request), timezone.now()
    weeks = request.GET.get("weeks", "")
    weeks = weeks if weeks in PERIODS else LONGEST
    clinic, since = clinic_of(user), now - timedelta(weeks=int(weeks))
    entries = list_adverse(user, since)
    walked = TrainingSession.objects.visible_to(user).filter(counted(), active_s__gt=0)
    sessions = walked.filter(created_at__gte=since).count()
    context = {
        "lists": [
            (_("Newest first"), [one for one in entries if not one.is_simulated][:MAX_INCIDENTS]),
            (
                _("Simulated, not counted"),
                [one for one in entries if one.is_simulated][:MAX_INCIDENTS],
            ),
        ],
        "now": clinic_time(now, clinic),
        "since": clinic_time(since, clinic),
        "sessions": sessions,
        "weeks": weeks,
        "periods": PERIODS,
        "figures": count_adverse(entries),
    }
    return render(request, "sessions/incidents.html", context)
