"""The patients of a clinic at a glance: who comes, who is stuck, who improves, who is due."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from enum import StrEnum

from django.utils.functional import Promise
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.patients.visits import MISSED_AFTER, Visit, is_late
from rehab.people.models import Patient, User
from rehab.people.simulated import counted
from rehab.sessions.formatting import clinic_time, format_day, format_number
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day.today import IS_OPEN, begun_today

LOOKED_BACK = timedelta(weeks=26)
COMING = timedelta(weeks=4)
COMPARED = 3  # the newest sessions
UNMOVED = 0.02  # up to which change of the goal it has not moved
IMPROVED = 0.05  # from which change of the goal on a patient has improved, or got worse
OVERDUE = timedelta(days=7)  # without a session and without a planned visit


class Flag(StrEnum):
    """What a therapist has to think of."""

    DUE = "due"
    STUCK = "stuck"
    IMPROVING = "improving"
    DECLINING = "declining"
    NEW = "new"


ORDER = [Flag.DUE, Flag.DECLINING, Flag.STUCK, Flag.IMPROVING, Flag.NEW]  # who needs thought first
FLAGS: dict[str, str | Promise] = {
    Flag.DUE: _("overdue"),
    Flag.DECLINING: _("getting worse"),
    Flag.STUCK: _("stuck"),
    Flag.IMPROVING: _("improving"),
    Flag.NEW: _("new"),
}

REASONS: dict[str, str | Promise] = {
    Flag.DECLINING: _("easier goal than 3 sessions ago"),
    Flag.STUCK: _("no harder goal in 3 sessions"),
    Flag.IMPROVING: _("harder goal than 3 sessions ago"),
}


@dataclass(frozen=True, slots=True)
class Walk:
    """A session that counts: its day, its goal at the end, and which way that measure is better."""

    day: date
    goal: float | None
    measure: int
    unit: str
    higher_is_better: bool


@dataclass(frozen=True, slots=True)
class Case:
    """A patient of the list.

    ``walks``: the newest sessions, the newest first; ``recent``: how many of the last four weeks;
    ``missed``: the last planned day whose visit is past, if the patient has not walked since;
    ``may_come``: it is today, and the patient only late; ``is_here``: a session of today is open.
    """

    patient: Patient
    walks: Sequence[Walk]
    recent: int
    next_visit: Visit | None
    missed: date | None
    flags: tuple[Flag, ...]
    may_come: bool = False
    is_here: bool = False

    @property
    def needs_visit(self) -> bool:
        """Whether no visit is to come: who is late today may yet come."""
        return self.next_visit is None

    @property
    def goals(self) -> str:
        """How the goal went over the newest sessions of the present measure, as text."""
        shown = [format_number(goal) for goal in reversed(self._compared)]
        kept = [goal for place, goal in enumerate(shown) if not place or shown[place - 1] != goal]
        return f"{' → '.join(kept)} {self.walks[0].unit}" if kept else ""

    def tell(self, today: date) -> list[tuple[Flag, str, str]]:
        """Return each flag with its label and, where that is not plain, its reason in words."""
        return [(flag, str(FLAGS[flag]), self._reason(flag, today)) for flag in self.flags]

    def _reason(self, flag: Flag, today: date) -> str:
        if flag is not Flag.DUE:
            return str(REASONS.get(flag, ""))
        if self.missed is None:
            return gettext("no visit planned")
        if self.missed < today:
            return gettext("did not come on %(day)s") % {"day": format_day(self.missed, today)}
        return gettext("late today") if self.may_come else gettext("did not come today")

    @property
    def _compared(self) -> list[float]:
        return [walk.goal for walk in same_measure(self.walks) if walk.goal is not None]


def same_measure(walks: Sequence[Walk]) -> list[Walk]:
    """Return the newest walks that train what the newest one trains, as many as are compared."""
    newest = walks[:COMPARED]
    return [walk for walk in newest if walk.measure == newest[0].measure]


def judge(
    walks: Sequence[Walk], next_day: date | None, missed: date | None, today: date
) -> tuple[Flag, ...]:
    """Return the flags of a patient.

    Parameters
    ----------
    walks
        The newest sessions, the newest first.
    next_day, missed
        The next planned visit; a planned day whose visit is past, without a walk on it or since.
    today
        By the clinic's clock.
    """
    flags = []
    is_away = not walks or walks[0].day <= today - OVERDUE
    if missed is not None or (next_day is None and is_away):
        flags.append(Flag.DUE)
    compared = same_measure(walks)
    goals = [walk.goal for walk in compared if walk.goal]
    if not walks:
        flags.append(Flag.NEW)
    if len(goals) == COMPARED:
        change = goals[0] / goals[-1] if compared[0].higher_is_better else goals[-1] / goals[0]
        if change <= 1 - IMPROVED:
            flags.append(Flag.DECLINING)
        elif change <= 1 + UNMOVED:
            flags.append(Flag.STUCK)
        elif change >= 1 + IMPROVED:
            flags.append(Flag.IMPROVING)
    return tuple(flags)


def load_caseload(user: User, now: datetime) -> list[Case]:
    """Return the patients whose program goes on: by need (`ORDER`), by when they come today, then
    by their last session.

    ``now`` is in the clinic's time zone.
    """
    today = now.date()
    patients = Patient.objects.visible_to(user).filter(counted(), ended_at=None)
    sessions = TrainingSession.objects.visible_to(user).filter(
        counted(),
        patient__in=patients,
        excluded=False,
        active_s__gt=0,
        created_at__gte=now - LOOKED_BACK,
    )
    walks: defaultdict[int, list[Walk]] = defaultdict(list)
    for one in sessions.select_related("measure", "clinic").defer("plan").order_by("-created_at"):
        measure = one.measure
        day = clinic_time(one.began_at, one.clinic).date()
        walks[one.patient_id].append(
            Walk(day, one.goal, measure.pk, measure.unit, measure.higher_is_better)
        )
    visits: defaultdict[int, list[Visit]] = defaultdict(list)
    planned = Visit.objects.visible_to(user).filter(day__gte=today - COMING)
    for visit in planned.order_by("day", "at"):
        visits[visit.patient_id].append(visit)
    opened = TrainingSession.objects.visible_to(user).filter(counted(), IS_OPEN, begun_today(now))
    here = set(opened.values_list("patient", flat=True))
    cases = [
        _to_case(each, walks[each.pk], visits[each.pk], now, is_here=each.pk in here)
        for each in patients
    ]
    return sorted(
        cases,
        key=lambda case: (
            min((ORDER.index(flag) for flag in case.flags), default=ORDER.index(Flag.NEW)),
            _time_today(case, today),
            not case.walks,
            case.walks[0].day if case.walks else date.min,
            case.patient.nickname,
        ),
    )


def _time_today(case: Case, today: date) -> time:
    """Return when somebody comes today; the day's last moment for who does not, or at no time."""
    visit = case.next_visit
    return (visit.at if visit and visit.day == today else None) or time.max


def _to_case(
    patient: Patient,
    walks: Sequence[Walk],
    visits: Sequence[Visit],
    now: datetime,
    *,
    is_here: bool,
) -> Case:
    today = now.date()
    last = today if is_here else walks[0].day if walks else date.min
    gone = [v for v in visits if v.day == today and is_late(v.at, now, by=MISSED_AFTER)]
    coming = next((v for v in visits if v.day >= today and v.day > last and v not in gone), None)
    past = [v.day for v in visits if v.day < today or (v.day == today and is_late(v.at, now))]
    missed = next((day for day in reversed(past) if day > last), None)
    return Case(
        patient,
        walks,
        sum(walk.day > today - COMING for walk in walks),
        coming,
        missed,
        judge(walks, today if is_here else coming.day if coming else None, missed, today),
        not gone,
        is_here,
    )
