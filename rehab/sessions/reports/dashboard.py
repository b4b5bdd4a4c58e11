"""What a clinic sees first in the admin: today, this week, its stations, what wants attention."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from django.db.models import Count, F, OuterRef, Q, QuerySet, Subquery
from django.utils.dateformat import format as format_date
from django.utils.translation import gettext

from rehab.people.access import clinic_of
from rehab.people.models import Clinic, User
from rehab.people.roles import Right, Role, rights_of
from rehab.sessions.formatting import at_clinic, midnight_of, say_duration, say_number, say_rate
from rehab.sessions.live import runtime
from rehab.sessions.live.session import LiveSession
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import with_figures
from rehab.stations.models import Device, Station
from rehab.stations.presence import is_overdue, say_state
from rehab.training.changes import OPEN_STATES, State
from rehab.training.valences import VALENCES

SHOWN = 40  # sessions of today that are over; open ones are shown all
LONG_OPEN = timedelta(hours=3)  # no visit takes as long
REVOKED_FOR = timedelta(days=7)  # so long it is told that a device is shut out
# Who walks stands on top, then what could go on, then what is over.
ORDER = [State.RUNNING, State.PAUSED, State.READY, State.FINISHED, State.ABORTED]


@dataclass(frozen=True, slots=True)
class Today:
    """A session of today, or one that is still open."""

    session: TrainingSession
    who: str
    time: str
    state: str
    open: bool
    walked: str
    hit_rate: str


@dataclass(frozen=True, slots=True)
class Walked:
    """What was walked with one feedback type, or with all: wanted and hits by judged steps."""

    slug: str
    label: str
    sessions: int
    minutes: float
    strides: int
    hit_rate: float | None
    wanted: float | None

    @property
    def words(self) -> dict[str, str]:
        """Give the figures as they are written."""
        return {
            "minutes": say_duration(60 * self.minutes),
            "strides": say_number(self.strides, 0),
            "hit_rate": say_rate(self.hit_rate),
            "wanted": say_rate(self.wanted),
        }


@dataclass(frozen=True, slots=True)
class Week:
    """Monday to now. ``simulated``: nobody walked, so these are simulated sessions."""

    total: Walked
    types: list[Walked]
    days: list[str]
    minutes: list[float]
    simulated: bool
    left_out: int

    @property
    def chart(self) -> dict[str, Any]:
        """Give the data of both charts."""
        return {
            "days": self.days,
            "minutes": [round(minutes, 1) for minutes in self.minutes],
            "types": [
                {
                    "slug": own.slug,
                    "label": own.label,
                    "hit": own.hit_rate and round(100 * own.hit_rate, 1),
                    "wanted": own.wanted and round(100 * own.wanted, 1),
                }
                for own in self.types
                if own.hit_rate is not None
            ],
        }


@dataclass(frozen=True, slots=True)
class Place:
    """A station with its devices, each with its state, and who is there."""

    station: Station
    devices: list[tuple[Device, str]]
    session: TrainingSession | None
    here: dict[str, bool]  # what is connected to the open session


@dataclass(frozen=True, slots=True)
class Matter:
    """Something that wants attention, and where to mend it."""

    words: str
    name: str
    key: int


def look(user: User, now: datetime) -> dict[str, Any]:
    """Give what somebody of a clinic sees; each part as far as the role sees its rows."""
    clinic = clinic_of(user)
    today = read_today(user, clinic, now)
    open_now = [line.session for line in today if line.open]
    places = list(read_places(user, open_now, now)) if _sees(user, Station) else []
    return {
        "clinic": clinic,
        "now": at_clinic(now, clinic),
        "today": today,
        "walking": sum(line.session.state == State.RUNNING for line in today),
        "week": read_week(user, clinic, now),
        "places": places,
        "matters": list(find_matters(user, today, places, now)),
        "steers": user.role in (Role.LEAD, Role.PT),
    }


def _sees(user: User, model: type) -> bool:
    return Right.VIEW in rights_of(user.role, model.__name__)


def read_today(user: User, clinic: Clinic, now: datetime) -> list[Today]:
    """Give today's sessions by the clinic's clock, and every open one, those that run on top."""
    midnight = midnight_of(at_clinic(now, clinic))
    is_open = Q(state__in=[state.value for state in OPEN_STATES])
    begun = Q(created_at__gte=midnight) | Q(started_at__gte=midnight)
    sessions = TrainingSession.objects.visible_to(user).filter(is_open | begun).defer("plan")
    lines = (
        with_figures(user, sessions)
        .select_related("patient", "station", "measure")
        .order_by("-created_at", "-pk")
    )
    rows = [*lines.filter(is_open), *lines.exclude(is_open)[:SHOWN]]
    rows.sort(key=lambda row: ORDER.index(State(row.state)))
    by_name = user.role != Role.RESEARCHER
    return [
        Today(
            session=row,
            who=row.patient.nickname if by_name else row.patient.pseudonym,
            time=_say_time(at_clinic(row.started_at or row.created_at, clinic), midnight),
            state=row.get_state_display(),
            open=State(row.state) in OPEN_STATES,
            walked=say_duration(row.active_s),
            hit_rate=_say_hits(row),
        )
        for row in rows
    ]


def _say_hits(row: Any) -> str:
    """Give the hit rate; of an open session as it stands by now, where this process runs it."""
    if State(row.state) not in OPEN_STATES:
        return say_rate(row.metric_hit_rate)
    running = _find_running(row)
    rate = running.actor.fold.feedback.hit_rate if running else None
    return "" if rate is None else say_rate(rate)


def _find_running(session: TrainingSession) -> LiveSession | None:
    live = runtime.peek()
    return live.sessions.get(session.pk) if live else None


def _say_time(moment: datetime, midnight: datetime) -> str:
    day = "" if moment >= midnight else format_date(moment, "M j") + ", "
    return f"{day}{moment:%H:%M}"


def read_week(user: User, clinic: Clinic, now: datetime) -> Week:
    """Give the figures of the clinic's week so far: of what people walked, corrections heeded."""
    here = at_clinic(now, clinic)
    monday = midnight_of(here - timedelta(days=here.weekday()))
    begun = TrainingSession.objects.visible_to(user).filter(
        started_at__gte=monday, started_at__lte=now
    )
    steps = SessionMetric.objects.visible_to(user).filter(session=OuterRef("pk"), slug="steps")
    rows = list(
        with_figures(user, begun)
        .annotate(judged=Subquery(steps.values("value")))
        .order_by()
        .values(
            *("pk", "valence", "simulated", "left_out", "active_s", "started_at"),
            *("metric_hit_rate", "judged", "plan__target__hit_rate"),
        )
    )
    counted = [row for row in rows if not row["left_out"]]
    simulated = bool(counted) and all(row["simulated"] for row in counted)
    counted = [row for row in counted if row["simulated"] == simulated]
    strides = _count_strides(user, begun.filter(left_out=False, simulated=simulated))
    minutes = [0.0] * 7
    for row in counted:
        minutes[at_clinic(row["started_at"], clinic).weekday()] += row["active_s"] / 60
    return Week(
        total=_sum_up("", "", counted, sum(strides.values())),
        types=[
            _sum_up(kind.slug, kind.label, own, strides[kind.slug])
            for kind in VALENCES.values()
            if (own := [row for row in counted if row["valence"] == kind.slug])
        ],
        days=[format_date(monday + timedelta(days=day), "D") for day in range(7)],
        minutes=minutes,
        simulated=simulated,
        left_out=len(rows) - len(counted),
    )


def _count_strides(user: User, sessions: QuerySet[TrainingSession]) -> defaultdict[str, int]:
    """Give the valid strides of the trained leg, by feedback type."""
    found: defaultdict[str, int] = defaultdict(int)
    rows = (
        Step.objects.visible_to(user)
        .filter(session__in=sessions.values("pk"), valid=True)
        .filter(side=F("session__trained_side"))
        .values_list("session__valence")
        .annotate(Count("pk"))
        .order_by()
    )
    found.update(rows)
    return found


def _sum_up(slug: str, label: str, rows: list[dict[str, Any]], strides: int) -> Walked:
    judged = [row for row in rows if row["metric_hit_rate"] is not None and row["judged"]]
    wished = [row for row in judged if row["plan__target__hit_rate"] is not None]
    return Walked(
        slug=slug,
        label=gettext(label) if label else "",
        sessions=len(rows),
        minutes=sum(row["active_s"] for row in rows) / 60,
        strides=strides,
        hit_rate=_mean(judged, "metric_hit_rate"),
        wanted=_mean(wished, "plan__target__hit_rate"),
    )


def _mean(rows: list[dict[str, Any]], name: str) -> float | None:
    """Give a mean in which each judged step weighs the same."""
    weight = sum(row["judged"] for row in rows)
    return sum(row[name] * row["judged"] for row in rows) / weight if weight else None


def read_places(user: User, open_now: list[TrainingSession], now: datetime) -> Iterator[Place]:
    """Give the stations with their devices, and what is connected to their open sessions."""
    devices: defaultdict[int, list[Device]] = defaultdict(list)
    for device in Device.objects.visible_to(user).order_by("kind", "name"):
        devices[device.station_id].append(device)
    at_station = {session.station_id: session for session in reversed(open_now)}
    for station in Station.objects.visible_to(user):
        session = at_station.get(station.pk)
        yield Place(
            station,
            [(device, say_state(device, now)) for device in devices[station.pk]],
            session,
            find_here(session, now) if session else {},
        )


def find_here(session: TrainingSession, now: datetime) -> dict[str, bool]:
    """Give what is connected to a session of this process; nothing where another one runs it."""
    running = _find_running(session)
    if running is None:
        return {}
    told = running.presence(now)
    return {"source": told["source"], "tablet": bool(told["tablets"]), "robot": told["robot"]}


def find_matters(
    user: User, today: list[Today], places: list[Place], now: datetime
) -> Iterator[Matter]:
    """Give what wants attention, each with its cure."""
    for line in today:
        began = line.session.started_at or line.session.created_at
        if line.open and now - began > LONG_OPEN and user.role != Role.RESEARCHER:
            words = gettext("The session of %(name)s is open since %(time)s. End it.")
            yield Matter(words % {"name": line.who, "time": line.time}, "monitor", line.session.pk)
    for place in places:
        for device, _state in place.devices:
            names = {"name": device.name, "station": place.station.name}
            link = "admin:rehab_device_change"
            if is_overdue(device, now):
                words = gettext(
                    "%(name)s at %(station)s has never dialed in. Give it its token, or revoke it."
                )
                yield Matter(words % names, link, device.pk)
            elif device.revoked_at is not None and now - device.revoked_at < REVOKED_FOR:
                words = gettext(
                    "%(name)s at %(station)s is revoked and shut out. Give it a new token to let "
                    "it in again."
                )
                yield Matter(words % names, link, device.pk)
