"""Sessions compared: weeks, feedback types and patients, at equal goals, with what went wrong.

Descriptive. Sessions of one patient resemble each other, so where a group has several patients its
interval is that of their means, and of the sessions' figures where it has one.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime, timedelta
from math import floor
from urllib.parse import urlencode

from django.db.models import QuerySet
from django.utils.formats import date_format
from django.utils.functional import Promise
from django.utils.translation import gettext, ngettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.simulated import counted
from rehab.sessions.corrections import CorrectedField, SessionCorrection
from rehab.sessions.formatting import NBSP, clinic_time, format_number
from rehab.sessions.log import EVENTS, Remark
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import CONDITIONS, load_conditions, name_assistance
from rehab.sessions.reports.intervals import MeanInterval, mean_interval
from rehab.sessions.reports.remarks import ADVERSE, Noted, load_noted
from rehab.sessions.reports.trend import FIGURES, metrics_by_session
from rehab.training.valences import VALENCES

MAX_SESSIONS = 2000  # the newest
LEAST_FOR_INTERVAL = 3  # patients, or sessions of one
EQUAL_WITHIN = 1.1  # goals of one measure count as equal up to so much of the lowest


@dataclass(slots=True)
class Walked:
    """A session as it is compared."""

    session: TrainingSession
    at: datetime  # by the clinic's clock
    hit_rate: float | None
    improvement: float | None = None  # over its baseline, in percent
    adverse: list[Noted] = field(default_factory=list)
    exertion: float | None = None  # the highest that was noted, Borg CR10
    note: str = ""
    conditions: dict[str, float] = field(default_factory=dict)  # `summarize_conditions`
    band: str = ""  # the goals that its goal is compared with (`goal_bands`)

    @property
    def week(self) -> date:
        """The Monday of its week."""
        return self.at.date() - timedelta(days=self.at.weekday())

    @property
    def valence(self) -> str:
        """The slug of its feedback type; a session that was changed is none of one type."""
        return "" if self.session.changed_to else self.session.valence

    @property
    def type_label(self) -> str:
        """Its feedback type as text."""
        if not self.valence:
            return gettext("changed during the session")
        return gettext(VALENCES[self.valence].label)


@dataclass(frozen=True, slots=True)
class Group:
    """Sessions that are compared as one: a week's, a type's, a patient's."""

    label: str
    valence: str  # of all its sessions, or none
    sessions: int
    patients: int
    hit_rate: MeanInterval | None
    improvement: MeanInterval | None
    minutes: float
    adverse: list[tuple[str, int]]
    exertion: MeanInterval | None

    @property
    def unit(self) -> str:
        """What its interval is of."""
        if self.hit_rate is None:
            return ""
        say = _say_patients if self.patients > 1 else _say_sessions
        return say(self.hit_rate.count)

    @property
    def lacks(self) -> str:
        """What is missing for an interval; "" where it has one."""
        if self.hit_rate is None or self.hit_rate.low is not None:
            return ""
        count = LEAST_FOR_INTERVAL - self.hit_rate.count
        words = (
            ngettext("needs %(count)s more patient", "needs %(count)s more patients", count)
            if self.patients > 1
            else ngettext("needs %(count)s more session", "needs %(count)s more sessions", count)
        )
        return words % {"count": count}

    @property
    def size(self) -> str:
        """How many sessions of how many patients."""
        return f"{_say_sessions(self.sessions)}, {_say_patients(self.patients)}"


def _say_sessions(count: int) -> str:
    return ngettext("%(count)s session", "%(count)s sessions", count) % {"count": count}


def _say_patients(count: int) -> str:
    return ngettext("%(count)s patient", "%(count)s patients", count) % {"count": count}


def load_walked(user: User, sessions: QuerySet[TrainingSession]) -> list[Walked]:
    """Return the newest of these sessions that count and were walked, the newest first."""
    counted = sessions.filter(excluded=False, legacy_id=None, active_s__gt=0)
    chosen = counted.select_related("patient", "clinic", "measure").defer("plan", "checkpoint")
    rows = list(chosen.order_by("-created_at", "-pk")[:MAX_SESSIONS])
    figures = metrics_by_session(user, rows)
    walked = {}
    for row in rows:
        found = figures.get(row.pk, {})
        at, improvement = clinic_time(row.began_at, row.clinic), found.get(FIGURES[-1])
        walked[row.pk] = Walked(row, at, found.get("hit_rate"), improvement)
    for key, noted in load_noted(user, walked).items():
        walked[key].adverse = [one for one in noted if one.is_adverse]
    for key, conditions in load_conditions(user, rows).items():
        walked[key].conditions = conditions
        walked[key].exertion = conditions.get(Remark.BORG)
    notes = SessionCorrection.objects.visible_to(user).filter(field=CorrectedField.NOTE)
    for correction in notes.filter(session__in=list(walked)).order_by("pk"):
        walked[correction.session_id].note = correction.new
    return list(walked.values())


def goal_bands(walked: Sequence[Walked]) -> list[tuple[str, str, int]]:
    """Sort sessions into bands of equal goals; return these, the commonest first.

    Each is its key, its goals in words, and how many sessions it has.
    """
    found: defaultdict[str, list[Walked]] = defaultdict(list)
    with_goal = [one for one in walked if one.session.goal is not None and one.session.goal > 0]
    lowest: dict[int, float] = {}  # of the present band, by measure
    for one in sorted(with_goal, key=lambda one: one.session.goal or 0.0):
        goal, measure = one.session.goal or 0.0, one.session.measure_id
        if measure not in lowest or goal > EQUAL_WITHIN * lowest[measure]:
            lowest[measure] = goal
        one.band = f"{measure}:{lowest[measure]:g}"
        found[one.band].append(one)
    ordered = sorted(found.items(), key=lambda entry: -len(entry[1]))
    return [(key, _describe_goals(members), len(members)) for key, members in ordered]


def _describe_goals(walked: Sequence[Walked]) -> str:
    goals = [one.session.goal or 0.0 for one in walked]
    low, high = format_number(min(goals)), format_number(max(goals))
    return f"{low if low == high else f'{low}–{high}'} {walked[0].session.measure.unit}"


def _by_band(
    label: str | Promise, kind: Remark, width: float, unit: str
) -> tuple[str | Promise, Callable[[Walked], str], Callable[[Walked], str]]:
    """Return how sessions are compared by a condition, in bands of equal width and 0 by itself."""

    def find_band(one: Walked) -> int:
        value = one.conditions.get(kind)
        if not value:
            return -1 if value is None else 0
        return 1 + floor(round(value / width, 6))

    def describe(one: Walked) -> str:
        band = find_band(one)
        if band <= 0:
            return gettext("not noted") if band else f"0{NBSP}{unit}"
        places = 0 if width >= 1 else 1
        low, high = (format_number(width * end, places) for end in (band - 1, band))
        return f"{low}–{high}{NBSP}{unit}"

    return label, lambda one: f"{find_band(one):03d}", describe


def _name_help(one: Walked) -> str:
    return name_assistance(one.conditions) or gettext("without help, as far as noted")


# What sessions may be compared by: the choice's label, the groups' sorting key, and their label.
KEYS: dict[str, tuple[str | Promise, Callable[[Walked], str], Callable[[Walked], str]]] = {
    "week": (
        _("Weeks"),
        lambda one: one.week.isoformat(),
        lambda one: gettext("Week of %(day)s") % {"day": date_format(one.week, "DATE_FORMAT")},
    ),
    "type": (
        _("Feedback types"),
        lambda one: f"{[*VALENCES, ''].index(one.valence):03d}",
        lambda one: one.type_label,
    ),
    "patient": (
        _("Patients"),
        lambda one: f"{one.session.patient.nickname} {one.session.patient_id}",
        lambda one: f"{one.session.patient.nickname} ({one.session.patient.code})",
    ),
    "speed": _by_band(_("Belt speed"), Remark.BELT_SPEED, 0.2, "m/s"),
    "support": _by_band(_("Body-weight support"), Remark.WEIGHT_SUPPORT, 10, "%"),
    "help": (_("Help by hand or aid"), _name_help, _name_help),
}


def compare(walked: Sequence[Walked], by: str) -> list[Group]:
    """Return the groups that sessions fall in: the newest week first, types as in the set-up."""
    _label, key, describe = KEYS[by]
    found: defaultdict[str, list[Walked]] = defaultdict(list)
    for one in walked:
        found[key(one)].append(one)
    return [
        _summarize(describe(found[name][0]), found[name])
        for name in sorted(found, reverse=by == "week")
    ]


def _summarize(label: str, walked: Sequence[Walked]) -> Group:
    kinds = Counter(adverse.kind for one in walked for adverse in one.adverse)
    valences = {one.valence for one in walked}
    return Group(
        label=label,
        valence=valences.pop() if len(valences) == 1 else "",
        sessions=len(walked),
        patients=len({one.session.patient_id for one in walked}),
        hit_rate=_known(mean_interval(_independent(walked, lambda one: one.hit_rate), (0, 1))),
        improvement=mean_interval(_independent(walked, lambda one: one.improvement)),
        minutes=sum(one.session.active_s for one in walked) / 60,
        adverse=[(str(EVENTS[kind]), kinds[kind]) for kind in ADVERSE if kinds[kind]],
        exertion=mean_interval(_independent(walked, lambda one: one.exertion), (0, 10)),
    )


def _known(found: MeanInterval | None) -> MeanInterval | None:
    """Return a mean, without an interval where too few values make one."""
    if found is None or found.count >= LEAST_FOR_INTERVAL:
        return found
    return replace(found, low=None, high=None)


def _independent(walked: Sequence[Walked], figure: Callable[[Walked], float | None]) -> list[float]:
    """Return each patient's mean of a figure; of one patient the sessions' figures."""
    values: defaultdict[int, list[float]] = defaultdict(list)
    for one in walked:
        value = figure(one)
        if value is not None:
            values[one.session.patient_id].append(value)
    if len(values) == 1:
        (only,) = values.values()
        return only
    return [sum(each) / len(each) for each in values.values()]


PERIODS = {"4": _("4 weeks"), "12": _("12 weeks"), "52": _("a year"), "": _("All time")}  # in weeks
ANY_GOAL = "any"


@dataclass(frozen=True, slots=True)
class View:
    """What the insight page was asked for: the choices, and the sessions that they leave.

    ``bands`` are those of all sessions of the period.
    """

    by: str
    weeks: str
    band: str
    bands: list[tuple[str, str, int]]
    shown: list[Walked]

    @property
    def query(self) -> str:
        """The choices as the query of an address."""
        return urlencode({"by": self.by, "weeks": self.weeks, "goal": self.band})


def read_view(user: User, query: Mapping[str, str], now: datetime) -> View:
    """Return what a query asks for; the commonest goals where it names none that were walked."""
    by = query.get("by", "")
    weeks = query.get("weeks", "12")
    weeks = weeks if weeks in PERIODS else "12"
    sessions = TrainingSession.objects.visible_to(user).filter(counted())
    if weeks:
        sessions = sessions.filter(created_at__gte=now - timedelta(weeks=int(weeks)))
    walked = load_walked(user, sessions)
    bands, band = goal_bands(walked), query.get("goal", "")
    if band != ANY_GOAL and band not in {key for key, _words, _count in bands}:
        band = bands[0][0] if bands else ANY_GOAL
    shown = [one for one in walked if band in (ANY_GOAL, one.band)]
    return View(by if by in KEYS else "week", weeks, band, bands, shown)


def to_table(walked: Sequence[Walked]) -> Iterator[list[object]]:
    """Yield a head and a line for each session; in English, as all files are."""
    yield [
        *("began", "code", "feedback_type", "measure", "unit", "goal", "hit_rate", "active_s"),
        *map(str, ADVERSE),
        *("highest_borg", *map(str, CONDITIONS), "highest_pain", "note"),
    ]
    for one in walked:
        session = one.session
        counts = Counter(adverse.kind for adverse in one.adverse)
        valences = "+".join([session.valence, *session.later_valences])
        yield [
            *(one.at, session.patient.code, valences, session.measure.slug, session.measure.unit),
            *(session.goal, one.hit_rate, session.active_s),
            *(counts[kind] for kind in ADVERSE),
            one.exertion,
            *(one.conditions.get(kind) for kind in (*CONDITIONS, Remark.PAIN)),
            one.note,
        ]
