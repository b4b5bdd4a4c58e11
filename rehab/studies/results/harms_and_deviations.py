"""What happened in a study's sessions beside the walking: harms, and deviations from the plan.

Both follow from the logs by themselves. Every attempt at a visit counts, also one that was
repeated, of everybody whose sessions stay in the study.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import date

from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.sessions.alarms import UNASKED
from rehab.sessions.formatting import clinic_time
from rehab.sessions.log import EVENTS, RobotEntry, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.remarks import ABOUT_A_FALL, ADVERSE, read_noted
from rehab.studies.analysis.participants import Attendance, Participant
from rehab.studies.models import Study
from rehab.studies.participants import StudyEvent, StudyVisit, counts_people_alone
from rehab.training.changes import ChangeKind, State
from rehab.training.controls import CONTROLS

HARMS = ADVERSE
# The course of a session as it is planned; whoever changes anything else of it deviates.
PLANNED = (
    *(ChangeKind.START, ChangeKind.PAUSE, ChangeKind.RESUME, ChangeKind.FINISH),
    *(ChangeKind.ABORT, ChangeKind.CHART_STYLE),
)
CHANGES = tuple(str(kind) for kind in CONTROLS if kind not in PLANNED)
DEVIATIONS = (*CHANGES, RobotEntry.STOP.value)
ENDED_EARLY, UNWALKED = "ended_early", "phases_not_walked"
EXCLUDED, UNBLINDED, OUTSIDE = "excluded", "unblinded", "outside_window"
OTHERS = {
    ENDED_EARLY: _("session ended early"),
    UNWALKED: _("finished before the last phase"),
    EXCLUDED: _("session excluded by a correction"),
    UNBLINDED: _("arm revealed"),
    OUTSIDE: _("visit outside its window"),
}
REVEALED = (StudyEvent.Kind.UNBLINDED, StudyEvent.Kind.EMERGENCY)


@dataclass(frozen=True, slots=True)
class Occurrence:
    """Something that happened.

    Attributes
    ----------
    what, value
        A kind of the log, or of `OTHERS`; the value after a change, of a fall how badly (0 to 3).
    participant, arm, visit
        Whose; at a visit without a number in the study as a whole, in the first arm.
    """

    what: str
    participant: str
    arm: str
    visit: int | None
    value: float | None = None

    @property
    def is_harm(self) -> bool:
        """Whether somebody was, or could have been, hurt."""
        return self.what in HARMS

    @property
    def kind(self) -> str:
        """What files call it."""
        return "harm" if self.is_harm else "deviation"


@dataclass(frozen=True, slots=True)
class ConductRow:
    """How often something happened in each arm, and to how many people."""

    what: str
    kind: str
    counts: dict[str, tuple[int, int]]

    @property
    def label(self) -> str:
        """What people call it."""
        return label_of(self.what)


def label_of(what: str) -> str:
    """Return what people call an occurrence."""
    return gettext(str(OTHERS.get(what) or dict(EVENTS)[what]))


def find_days_off(study: Study, visits: Iterable[StudyVisit]) -> dict[int, int]:
    """Return how many days after its planned one each visit was walked, by its key.

    Of a repeated visit the first attempt's day counts. ``visits``: all attempts, in their order,
    each with its session.
    """
    planned: dict[tuple[int, int], date] = {}
    found = {}
    for visit in visits:
        day = planned.setdefault((visit.enrollment_id, visit.number), visit.day)
        if visit.session is not None:
            walked = clinic_time(visit.session.created_at, study.clinic).date()
            found[visit.pk] = (walked - day).days
    return found


def read_occurrences(study: Study) -> tuple[Occurrence, ...]:
    """Return all that happened in a study, by participant and visit."""
    visits = StudyVisit.everywhere.filter(enrollment__study=study, session__isnull=False)
    related = ("enrollment__allocation", "enrollment__patient", "session")
    of_people = counts_people_alone(study)
    found: list[Occurrence] = []
    in_order = list(visits.select_related(*related).order_by("enrollment", "number", "attempt"))
    days_off = find_days_off(study, in_order)
    for visit in in_order:
        enrollment, session = visit.enrollment, visit.session
        if of_people and visit.is_simulated:
            continue
        if enrollment.is_analyzed and session is not None:
            place = (
                enrollment.code,
                enrollment.allocation.group.split("-")[visit.period],
                visit.number,
            )
            found += _of_session(session, lambda *about, place=place: _make(place, *about))
            off = days_off[visit.pk]
            if study.window_days is not None and abs(off) > study.window_days:
                found.append(_make(place, OUTSIDE, off))
    events = study.events.filter(kind__in=REVEALED, enrollment__isnull=False)
    for event in events.select_related("enrollment__allocation"):
        if event.enrollment is not None and event.enrollment.is_analyzed:
            arm = event.enrollment.allocation.group.split("-")[0]
            found.append(Occurrence(UNBLINDED, event.enrollment.code, arm, None))
    return tuple(found)


def _make(place: tuple[str, str, int], what: str, value: float | None = None) -> Occurrence:
    return Occurrence(what, *place, value)


def _of_session(session: TrainingSession, make: Callable[..., Occurrence]) -> Iterator[Occurrence]:
    """Yield what happened in a session; falls that were none are left out."""
    events = SessionEvent.everywhere.filter(session=session).order_by("pk")
    for one in read_noted(events.filter(kind__in=(*HARMS, *ABOUT_A_FALL))):
        if one.is_adverse:
            yield make(one.kind.value, one.value if one.severity is None else float(one.severity))
    for kind, value, data in events.filter(kind__in=DEVIATIONS).values_list(
        "kind", "value", "data"
    ):
        if UNASKED not in data:
            yield make(kind, value)
    if session.state == State.ABORTED:
        yield make(ENDED_EARLY)
    if session.excluded:
        yield make(EXCLUDED)


def unwalked(participants: Iterable[Participant]) -> Iterator[Occurrence]:
    """Yield the sessions that were finished before their last phase."""
    for one in participants:
        for visit in one.visits if one.is_analyzed else ():
            if visit.attendance is Attendance.FINISHED and len(visit.phases) < visit.planned:
                yield Occurrence(UNWALKED, one.code, visit.arm, visit.number)


def count(occurrences: Iterable[Occurrence], arms: Iterable[str]) -> tuple[ConductRow, ...]:
    """Return how often each thing happened by arm: all harms, deviations that there were."""
    arms, happened = list(arms), list(occurrences)
    names = [*map(str, HARMS), *sorted({one.what for one in happened if not one.is_harm})]
    rows = []
    for what in names:
        counts = {}
        for arm in arms:
            mine = [one for one in happened if (one.what, one.arm) == (what, arm)]
            counts[arm] = len(mine), len({one.participant for one in mine})
        rows.append(ConductRow(what, "harm" if what in HARMS else "deviation", counts))
    return tuple(rows)
