"""A clinic's dashboard in the admin: today, this week, its stations and alerts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from django.utils.formats import date_format
from django.utils.translation import gettext

from rehab.people.access import clinic_of
from rehab.people.models import Clinic, User
from rehab.people.roles import Right, Role, may_see_names, rights_of
from rehab.people.simulated import counted
from rehab.sessions.alarms import Alarm, open_alarms
from rehab.sessions.formatting import clinic_time, format_duration, format_rate, midnight_of
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day.stations import StationStatus, find_live_session, station_statuses
from rehab.sessions.reports.day.today import IS_OPEN, todays_sessions
from rehab.sessions.reports.day.week import week_summary
from rehab.sessions.reports.trend import with_metrics
from rehab.stations.models import Device, Station
from rehab.stations.presence import is_overdue
from rehab.training.changes import OPEN_STATES, State

MAX_ENDED = 40  # ended sessions of today that are listed; open ones are all listed
OPEN_TOO_LONG = timedelta(hours=3)  # no visit takes as long
# Running sessions come first, then those that can go on, then those that have ended.
STATE_ORDER = [State.RUNNING, State.PAUSED, State.READY, State.FINISHED, State.ABORTED]


@dataclass(frozen=True, slots=True)
class SessionRow:
    """A session of today, or one that is still open, as text."""

    session: TrainingSession
    patient: str
    time: str
    state: str
    is_open: bool
    has_fallen: bool
    duration: str
    hit_rate: str


@dataclass(frozen=True, slots=True)
class Alert:
    """A problem, and the page where it is solved."""

    message: str
    url_name: str
    key: int


def dashboard_context(user: User, now: datetime) -> dict[str, Any]:
    """Return the template's context, with the rows that the user's role may see."""
    clinic = clinic_of(user)
    alarms = open_alarms(user, now) if user.role in (Role.LEAD, Role.PT) else []
    fallen = {one.session_id for one in alarms if one.kind == Alarm.FALL}
    today = sessions_today(user, clinic, now, fallen)
    open_sessions = [row.session for row in today if row.is_open]
    may_see_stations = Right.VIEW in rights_of(user.role, Station.__name__)
    stations = list(station_statuses(user, open_sessions, now)) if may_see_stations else []
    return {
        "clinic": clinic,
        "now": clinic_time(now, clinic),
        "today": today,
        "walking": sum(row.session.state == State.RUNNING for row in today),
        "week": week_summary(user, clinic, now),
        "stations": stations,
        "fallen": [one for one in alarms if one.kind == Alarm.FALL],
        "alerts": list(find_alerts(user, today, stations, now)),
        "can_steer": user.role in (Role.LEAD, Role.PT),
    }


def sessions_today(
    user: User, clinic: Clinic, now: datetime, fallen: Collection[int] = ()
) -> list[SessionRow]:
    """Return who walked today by the clinic's clock, and every open session.

    Those whose fall (``fallen``: keys) nobody has seen come first, then those that run.
    """
    local = clinic_time(now, clinic)
    sessions = todays_sessions(TrainingSession.objects.visible_to(user), local)
    rows = (
        with_metrics(user, sessions)
        .select_related("patient", "station", "measure")
        .order_by("-created_at", "-pk")
    )
    walked = rows.exclude(IS_OPEN).filter(counted(), active_s__gt=0)
    listed = [*rows.filter(IS_OPEN), *walked[:MAX_ENDED]]
    listed.sort(key=lambda row: (row.pk not in fallen, STATE_ORDER.index(State(row.state))))
    by_name = may_see_names(user.role)
    live = {row.pk: _live_figures(row) for row in listed}
    return [
        SessionRow(
            session=row,
            patient=row.patient.nickname if by_name else row.patient.pseudonym,
            time=_format_time(clinic_time(row.began_at, clinic), midnight_of(local)),
            state=row.get_state_display(),
            is_open=State(row.state) in OPEN_STATES,
            has_fallen=row.pk in fallen,
            duration=format_duration(live[row.pk][0]),
            hit_rate=live[row.pk][1],
        )
        for row in listed
    ]


def _live_figures(row: Any) -> tuple[float, str]:
    """Return time walked [s] and hit rate; of an open session now, where this process runs it."""
    if State(row.state) not in OPEN_STATES:
        return row.active_s, format_rate(row.metric_hit_rate)
    if (live := find_live_session(row)) is None:
        return row.active_s, ""
    fold = live.aggregate.fold
    rate = fold.feedback.hit_rate
    return fold.active_s, "" if rate is None else format_rate(rate)


def _format_time(moment: datetime, midnight: datetime) -> str:
    day = "" if moment >= midnight else date_format(moment, "MONTH_DAY_FORMAT") + ", "
    return f"{day}{moment:%H:%M}"


def find_alerts(
    user: User, today: Iterable[SessionRow], stations: Iterable[StationStatus], now: datetime
) -> Iterator[Alert]:
    """Yield the problems to solve: sessions left open, devices that cannot dial in."""
    for row in today:
        too_long = row.is_open and now - row.session.began_at > OPEN_TOO_LONG
        if too_long and may_see_names(user.role):
            message = gettext("The session of %(name)s has been open since %(time)s. End it.")
            names = {"name": row.patient, "time": row.time}
            yield Alert(message % names, "monitor", row.session.pk)
    for status in stations:
        for device, _state in status.devices:
            if (problem := _device_problem(device, now)) is not None:
                names = {"name": device.name, "station": status.station.name}
                yield Alert(problem % names, "admin:rehab_device_change", device.pk)


def _device_problem(device: Device, now: datetime) -> str | None:
    if is_overdue(device, now):
        return gettext("%(name)s at %(station)s has never connected. Connect it, or revoke it.")
    if device.has_expired(now):
        return gettext("The token of %(name)s at %(station)s has expired. Give it a new one.")
    if device.copy_seen_at is not None:
        return gettext(
            "An old token of %(name)s at %(station)s was used. Give it a new one, and find out who "
            "has the old one."
        )
    return None
