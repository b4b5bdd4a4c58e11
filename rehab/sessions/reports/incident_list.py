"""What went wrong in a clinic: falls, robots that stopped by themselves, pain and the like."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.utils.text import capfirst
from django.utils.translation import gettext

from rehab.people.access import clinic_of
from rehab.people.models import User
from rehab.people.simulated import counted, is_counted
from rehab.sessions.alarms import Alarm, Incident, find_incidents
from rehab.sessions.formatting import clinic_time, format_duration
from rehab.sessions.log import EVENTS, Remark, RuleEntry, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.remarks import ADVERSE, ICONS, Noted
from rehab.training.changes import ChangeKind

ANSWERED_WITHIN = timedelta(minutes=3)  # of a remark: what is done later has other reasons
PAUSES = {ChangeKind.PAUSE.value, RuleEntry.PLANNED_REST.value, RuleEntry.HEART_RATE_LIMIT.value}
ANSWERS = PAUSES | {Remark.REST.value, ChangeKind.FINISH.value, ChangeKind.ABORT.value}
DRAWN: dict[str, str] = {Alarm.FALL.value: "fall", Alarm.ROBOT_STOP.value: "robot"}
DRAWN |= {kind.value: name for kind, name in ICONS.items()}
RESUMES = {ChangeKind.START.value, ChangeKind.RESUME.value}


@dataclass(frozen=True, slots=True)
class Entry:
    """One of them, as text; ``at`` by the clinic's clock.

    ``hurt``: how badly, by a fall. ``then``: what followed, as when who saw it. ``is_one``: nobody
    took it back.
    """

    kind: str
    session: TrainingSession
    at: datetime
    what: str
    hurt: str
    noted_by: str
    then: str
    is_open: bool = False
    is_one: bool = True

    @property
    def icon(self) -> str:
        """The name of its drawing."""
        return DRAWN[self.kind]

    @property
    def is_simulated(self) -> bool:
        """Whether it was of a session that no figure counts."""
        return not is_counted(self.session.simulated)


def list_adverse(user: User, since: datetime) -> list[Entry]:
    """Return what went wrong in sessions that a user may see, the newest first."""
    entries = [_from_incident(user, one) for one in find_incidents(user, since)]
    entries += _list_remarks(user, since)
    return sorted(entries, key=lambda one: one.at, reverse=True)


def count_adverse(entries: Iterable[Entry]) -> list[tuple[str, int]]:
    """Return how often each thing went wrong in sessions that count: falls, near falls, others."""
    found = Counter(one.kind for one in entries if one.is_one and not one.is_simulated)
    named = {
        Alarm.FALL.value: gettext("Falls"),
        Remark.NEAR_FALL.value: gettext("Near falls"),
        Alarm.ROBOT_STOP.value: gettext("Robot stopped by itself"),
    }
    named |= {kind: capfirst(str(EVENTS[kind])) for kind in ADVERSE if kind not in named}
    return [(name, found[kind]) for kind, name in named.items()]


def _from_incident(user: User, incident: Incident) -> Entry:
    """Return a fall or a robot's stop, with who saw it when."""
    raised, ended, clinic = incident.raised, incident.ended, clinic_of(user)
    is_fall = raised.kind == Alarm.FALL
    what = (
        gettext("%(name)s fell.")
        if is_fall
        else gettext("The robot of %(name)s stopped by itself.")
    )
    hurt = gettext("not said") if is_fall and incident.was_one else ""
    if incident.severity is not None:
        hurt = str(incident.severity.label)
    if not incident.was_one:
        then = gettext("it was not a fall")
    elif ended is None:
        then = gettext("Nobody has answered yet") if is_fall else gettext("not seen yet")
    else:
        time = format_duration(max((ended.at - raised.at).total_seconds(), 0.0))
        then = gettext("seen after %(time)s by %(who)s") % {"time": time, "who": ended.by or "–"}
    return Entry(
        kind=raised.kind,
        session=raised.session,
        at=clinic_time(raised.at, clinic),
        what=what % {"name": raised.session.patient.nickname},
        hurt=capfirst(hurt),
        noted_by=str(raised.by or "") if is_fall else "",
        then=capfirst(then),
        is_open=ended is None,
        is_one=incident.was_one,
    )


def _list_remarks(user: User, since: datetime) -> list[Entry]:
    """Return remarks of sessions that count, with what was done then."""
    events = SessionEvent.objects.visible_to(user)
    kinds = [kind for kind in ADVERSE if kind != Remark.FALL]
    rows = events.filter(counted("session__"), kind__in=kinds, at__gte=since)
    noted = [
        Noted(row)
        for row in rows.select_related("by", "session__patient", "session__station").order_by("pk")
    ]
    of_session: defaultdict[int, list[SessionEvent]] = defaultdict(list)
    sessions = {one.event.session_id for one in noted}
    courses = events.filter(session__in=sessions, kind__in=ANSWERS | RESUMES).order_by("pk")
    for event in courses.defer("data"):
        of_session[event.session_id].append(event)
    clinic = clinic_of(user)
    return [
        Entry(
            kind=one.kind,
            session=one.event.session,
            at=clinic_time(one.at, clinic),
            what=f"{one.event.session.patient.nickname}: {one.words}",
            hurt="",
            noted_by=str(one.event.by or ""),
            then=capfirst(_find_answer(one.event, of_session[one.event.session_id], user)),
        )
        for one in noted
        if one.is_adverse
    ]


def _find_answer(remark: SessionEvent, course: Sequence[SessionEvent], user: User) -> str:
    """Return what became of the walk after a remark."""
    clinic = clinic_of(user)
    before = [one for one in course if one.pk < remark.pk and one.kind in PAUSES | RESUMES]
    after = [
        one
        for one in course
        if one.pk > remark.pk and one.kind in ANSWERS and one.at - remark.at <= ANSWERED_WITHIN
    ]
    if before and before[-1].kind in PAUSES:
        return gettext("during a pause")
    if after:
        what, at = EVENTS[after[0].kind], clinic_time(after[0].at, clinic)
        return f"{what}, {at:%H:%M}"
    return gettext("walked on")
