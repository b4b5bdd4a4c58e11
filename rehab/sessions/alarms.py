"""Alarms of a session, which stay until a therapist acknowledges them: falls, a robot's own stop.

They follow from the log alone, so that no restart and no other server forgets one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from itertools import groupby
from operator import attrgetter

from rehab.people.models import User
from rehab.sessions.log import ALARM_KINDS, FallSeverity, Remark, RobotEntry, SessionEvent
from rehab.sessions.state_messages import Message
from rehab.training.changes import ChangeKind, NotAllowed

SHOWN_FOR = timedelta(days=30)  # on pages of the clinic; the list of incidents has all
TOLD_FOR = timedelta(minutes=2)  # who took care of a fall
BY_PERSON = frozenset({"button"})  # reasons of a robot's stop that are a person's


class Alarm(StrEnum):
    """What needs to be acknowledged."""

    FALL = Remark.FALL.value
    ROBOT_STOP = RobotEntry.STOP.value  # by itself: a sensor felt something, or it broke down


ACKNOWLEDGMENTS = {
    Alarm.FALL: Remark.FALL_ACKNOWLEDGED,
    Alarm.ROBOT_STOP: Remark.STOP_ACKNOWLEDGED,
}
# Whoever lets the robot move again has seen that it stood.
ENDED_BY = {
    Remark.FALL_ACKNOWLEDGED.value: Alarm.FALL,
    Remark.STOP_ACKNOWLEDGED.value: Alarm.ROBOT_STOP,
    RobotEntry.ARM.value: Alarm.ROBOT_STOP,
}


# What a session's alarms, and who takes care of them, follow from.
FOLDED_KINDS = (
    *ALARM_KINDS,
    Remark.FALL_SEVERITY.value,
    ChangeKind.START.value,
    ChangeKind.RESUME.value,
)

# Holds the reason of a stop where the session has its robot off: no alarm, no harm.
UNASKED = "unasked"


def alarm_of(event: SessionEvent) -> Alarm | None:
    """Return the alarm that an event raises; None for none.

    A robot's own stop is stored with its reason; people and tablets give none.
    """
    if event.kind == Alarm.FALL:
        return Alarm.FALL
    reason = event.data.get("reason") if event.kind == Alarm.ROBOT_STOP else None
    return Alarm.ROBOT_STOP if reason and reason not in BY_PERSON else None


class OpenAlarms:
    """The alarms that nobody has acknowledged, folded from a session's events in their order."""

    def __init__(self, events: Iterable[SessionEvent] = ()) -> None:
        self._raised: defaultdict[Alarm, list[SessionEvent]] = defaultdict(list)
        self.stop_reason = ""  # of the robot's latest stop, where it stopped by itself
        self._fall_seen: SessionEvent | None = None  # a fall's acknowledgment, until all goes on
        self._severity: int | None = None  # of that fall, a `FallSeverity`
        for event in events:
            self.apply(event)

    def apply(self, event: SessionEvent) -> list[SessionEvent] | None:
        """Take an event in. Return the alarms that it ended; None where it concerns none."""
        if event.kind in (RobotEntry.STOP, RobotEntry.ARM):
            self.stop_reason = event.data.get("reason", "")
        if (raised := alarm_of(event)) is not None:
            self._raised[raised].append(event)
            return []
        if event.kind == Remark.FALL_WITHDRAWN:
            falls = self._raised[Alarm.FALL]
            return [falls.pop()] if falls else None
        if event.kind in (ChangeKind.START, ChangeKind.RESUME):
            self._fall_seen = None
        if event.kind == Remark.FALL_SEVERITY:
            self._severity = int(event.value or 0)
        if event.kind not in ENDED_BY:
            return None
        if event.kind == Remark.FALL_ACKNOWLEDGED:
            self._fall_seen, self._severity = event, None
        return self._raised.pop(ENDED_BY[event.kind], None)

    @property
    def events(self) -> list[SessionEvent]:
        """What raised them: the latest of each kind, falls first."""
        return [self._raised[kind][-1] for kind in Alarm if self._raised[kind]]

    @property
    def has_fallen(self) -> bool:
        """Whether the patient fell and nobody has acknowledged it."""
        return bool(self._raised[Alarm.FALL])

    def describe_to_patient(self) -> Message:
        """Return what the patient's page gets: whether somebody fell, and takes care of it."""
        return {"fell": self.has_fallen, "fall_seen": self._fall_seen is not None}

    def check_seen_to_fall(self) -> None:
        """Raise NotAllowed where nothing may move: the patient fell, nobody acknowledged it."""
        if self.has_fallen:
            raise NotAllowed("First take care of the fall: its button is on the therapist’s page.")

    def describe(self) -> Message:
        """Return them as the therapist's page gets them."""
        alarms = [
            {
                "kind": event.kind,
                "at": event.at.isoformat(),
                "by": str(event.by or ""),
                "reason": event.data.get("reason", ""),
            }
            for event in self.events
        ]
        seen = self._fall_seen and {
            "by": str(self._fall_seen.by or "–"),
            "at": self._fall_seen.at.isoformat(),
            "severity": self._severity,
        }
        return {"alarms": alarms, "stop_reason": self.stop_reason, "fall_seen": seen}


@dataclass(slots=True, eq=False)
class Incident:
    """What raised an alarm, and what ended it: an acknowledgment, or that it was none after all."""

    raised: SessionEvent
    ended: SessionEvent | None = None
    severity: FallSeverity | None = None

    @property
    def was_one(self) -> bool:
        """Whether nobody took it back."""
        return self.ended is None or self.ended.kind != Remark.FALL_WITHDRAWN


def find_incidents(user: User, since: datetime) -> list[Incident]:
    """Return the alarms that a user may see, acknowledged or not, the newest first."""
    rows = SessionEvent.objects.visible_to(user).filter(
        kind__in=[*ALARM_KINDS, Remark.FALL_SEVERITY.value], at__gte=since
    )
    chosen = rows.select_related(
        "by", "session__clinic", "session__patient__clinic", "session__station"
    )
    found: list[Incident] = []
    for _, some in groupby(chosen.order_by("session_id", "pk"), attrgetter("session_id")):
        found += fold_incidents(some)
    return sorted(found, key=lambda one: one.raised.at, reverse=True)


def check_no_open_fall(session_id: int, now: datetime) -> None:
    """Raise NotAllowed where a fall of a session's patient is open, in whichever session."""
    rows = SessionEvent.everywhere.filter(
        session__patient__sessions=session_id, kind__in=ALARM_KINDS, at__gte=now - SHOWN_FOR
    )
    for _, some in groupby(rows.order_by("session_id", "pk"), attrgetter("session_id")):
        OpenAlarms(some).check_seen_to_fall()


def fold_incidents(events: Iterable[SessionEvent]) -> list[Incident]:
    """Return the incidents among a session's events, in their order."""
    alarms, incidents = OpenAlarms(), dict[int, Incident]()
    for event in events:
        if event.kind == Remark.FALL_SEVERITY:
            among = [one for one in incidents.values() if one.raised.kind == Alarm.FALL]
            falls = [one for one in among if one.was_one]
            if falls:
                falls[-1].severity = FallSeverity(int(event.value or 0))
            continue
        for raised in alarms.apply(event) or []:
            incidents[raised.pk].ended = event
        if alarm_of(event) is not None:
            incidents[event.pk] = Incident(event)
    return list(incidents.values())


def open_alarms(user: User, now: datetime, station: int | None = None) -> list[SessionEvent]:
    """Return what raised the open alarms that a user may see, the newest first.

    ``station``: of its sessions alone.
    """
    found = [one.raised for one in find_incidents(user, now - SHOWN_FOR) if one.ended is None]
    return [one for one in found if station in (None, one.session.station_id)]


def falls_just_seen(user: User, now: datetime) -> list[SessionEvent]:
    """Return the latest acknowledgments of falls that a user may see: who does what is left."""
    rows = SessionEvent.objects.visible_to(user).filter(
        kind=Remark.FALL_ACKNOWLEDGED.value, at__gte=now - TOLD_FOR
    )
    chosen = rows.select_related("by", "session__clinic", "session__patient__clinic")
    return list(chosen.order_by("-pk"))
