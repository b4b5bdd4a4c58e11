"""What was noted in sessions: falls and how badly they hurt, exertion, and other remarks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

from django.utils.translation import gettext, ngettext

from rehab.people.models import User
from rehab.sessions.alarms import ACKNOWLEDGMENTS
from rehab.sessions.formatting import format_number
from rehab.sessions.log import EVENTS, FallSeverity, Remark, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import CONDITIONS, format_noted

ADVERSE = (Remark.FALL, Remark.NEAR_FALL, Remark.PAIN, Remark.DIZZINESS)
ABOUT_A_FALL = (Remark.FALL_SEVERITY, Remark.FALL_WITHDRAWN)  # part of the fall, not of their own
REMARKS = frozenset(Remark) - {*ABOUT_A_FALL, *ACKNOWLEDGMENTS.values()}

# The icon of each remark that is noted and no more, in the order of the buttons. A fall does more.
ICONS = {
    Remark.REST: "rest",
    Remark.PAIN: "pain",
    Remark.DIZZINESS: "dizzy",
    Remark.NEAR_FALL: "nearfall",
    Remark.VERBAL_CUE: "voice",
    Remark.BORG: "borg",
}


@dataclass(slots=True, eq=False)
class Noted:
    """A remark of the log, ``event``; of a fall with its ``severity``."""

    event: SessionEvent
    severity: FallSeverity | None = None

    @property
    def kind(self) -> Remark:
        """What was noted."""
        return Remark(self.event.kind)

    @property
    def at(self) -> datetime:
        """When."""
        return self.event.at

    @property
    def value(self) -> float | None:
        """How strong, where that is asked."""
        return self.event.value

    @property
    def is_adverse(self) -> bool:
        """Whether something went wrong; a pain of 0 is none."""
        return self.kind in ADVERSE and not (self.kind == Remark.PAIN and self.value == 0)

    @property
    def is_told(self) -> bool:
        """Whether it is something that happened, and not how the patient walked."""
        return self.kind not in CONDITIONS

    @property
    def words(self) -> str:
        """What it was, how strong, and how badly the patient was hurt."""
        label = f"{EVENTS[self.kind]} {format_noted(self.kind, self.value)}".rstrip()
        return label if self.severity is None else f"{label}, {self.severity.label}"


def read_noted(events: Iterable[SessionEvent]) -> list[Noted]:
    """Return the remarks among a session's events, in their order. A withdrawn fall was none."""
    noted: list[Noted] = []
    for event in events:
        falls = [one for one in noted if one.kind == Remark.FALL]
        if event.kind in REMARKS:
            noted.append(Noted(event))
        elif event.kind == Remark.FALL_SEVERITY and falls:
            falls[-1].severity = FallSeverity(int(event.value or 0))
        elif event.kind == Remark.FALL_WITHDRAWN and falls:
            noted.remove(falls[-1])
    return noted


def load_noted(user: User, sessions: Iterable[int]) -> dict[int, list[Noted]]:
    """Return adverse events and exertion of sessions, by key; without those that have none."""
    kinds = [*ADVERSE, *ABOUT_A_FALL, Remark.BORG]
    rows = SessionEvent.objects.visible_to(user).filter(session__in=list(sessions), kind__in=kinds)
    found: defaultdict[int, list[SessionEvent]] = defaultdict(list)
    for event in rows.order_by("pk").defer("data"):
        found[event.session_id].append(event)
    return {key: read_noted(events) for key, events in found.items()}


def describe_noted(user: User, sessions: Sequence[TrainingSession]) -> dict[int, str]:
    """Return how often a session's patient fell, and the exertion that was noted, by its key.

    Sessions in which neither was noted are left out.
    """
    noted = load_noted(user, (session.pk for session in sessions))
    found = {key: " · ".join(_describe(remarks)) for key, remarks in noted.items()}
    return {key: text for key, text in found.items() if text}


def _describe(noted: Sequence[Noted]) -> list[str]:
    falls = sum(one.kind == Remark.FALL for one in noted)
    borg = [one.value or 0 for one in noted if one.kind == Remark.BORG]
    parts = []
    if falls:
        parts.append(ngettext("%(count)s fall", "%(count)s falls", falls) % {"count": falls})
    if borg:
        low, high = format_number(min(borg), 0), format_number(max(borg), 0)
        felt = low if low == high else f"{low}–{high}"
        parts.append(gettext("Borg %(felt)s") % {"felt": felt})
    return parts
