"""What a patient's sessions come to on a board: which of them count, and the figure they make."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from itertools import groupby
from typing import Any

from django.db.models import CharField, Q, QuerySet
from django.db.models.functions import Cast

from rehab.boards.models import Leaderboard
from rehab.boards.periods import Period, period_of
from rehab.boards.rules import TYPED
from rehab.people.consent.models import Purpose, has_consented
from rehab.people.models import Patient
from rehab.sessions.log import SessionMetric
from rehab.training.changes import State
from rehab.training.valences import VALENCES

# Ratios that are shown in percent.
SHARES = frozenset({"hit_rate", "mean_performance"})
# What a day can add to a sum: no board may tempt anyone to walk on and on.
MOST_A_DAY = {"active_minutes": 60.0, "target_met": 1.0}
MOST = 10**9  # figures beyond it are cut there, so that every key has as many digits


@dataclass(frozen=True, slots=True)
class Walked:
    """A finished session as boards know it. ``cost``: the points of a miss."""

    session_id: int
    patient_id: int
    valence: str
    at: datetime
    day: date
    values: dict[str, float]
    cost: int


@dataclass(frozen=True, slots=True)
class Figure:
    """What stands in a row, and what it is ordered by.

    ``stake`` is what could be kept, where points are only lost. ``stale_on``: the day from which
    time alone alters it.
    """

    patient_id: int
    session_id: int
    valence: str
    value: int
    stake: int | None
    key: str
    stale_on: date | None


def read_figures(
    board: Leaderboard, now: datetime, patients: Collection[int] | None = None
) -> Iterator[Figure]:
    """Give the rows of a board of several: one for each patient, and type where those are apart.

    Only patients who have agreed and are in no blinded study; ``patients`` narrows it to these.
    """
    standing = standing_on(board)
    if patients is not None:
        standing = standing.filter(pk__in=patients)
    period = period_of(board, now)
    rows = SessionMetric.everywhere.filter(session__patient__in=standing)
    for _, walks in groupby(_read(board, rows, period), key=lambda walked: walked.patient_id):
        lists: dict[str, list[Walked]] = defaultdict(list)
        for walked in walks:
            lists[board.list_of(walked.valence)].append(walked)
        for valence, own in lists.items():
            yield sum_up(board, valence, own, period)


def read_own(board: Leaderboard, patient: Patient, valence: str, now: datetime) -> list[Figure]:
    """Give one patient's own rows, in no order: every session, or their sum where it adds up."""
    period = period_of(board, now)
    rows = SessionMetric.everywhere.filter(session__patient=patient)
    walks = [
        walked
        for walked in _read(board, rows, period)
        if board.list_of(walked.valence) == board.list_of(valence)
    ]
    if board.entry == Leaderboard.Entry.SUM:
        return [sum_up(board, valence, walks, period)] if walks else []
    return [make_figure(board, valence, [walked], period) for walked in walks]


def standing_on(board: Leaderboard) -> QuerySet[Patient]:
    """Give the patients who may stand on a board of several."""
    patients = Patient.everywhere.filter(boards__in=board.agreed, blinded=False)
    patients = patients.filter(Q(simulated=True) | has_consented(Purpose.BOARDS))
    if board.among == Leaderboard.Among.ACROSS:
        return patients.filter(clinic__boards_across=True)
    patients = patients.filter(clinic=board.clinic_id)
    return patients.filter(pk__in=group_of(board)) if board.has_group else patients


def group_of(board: Leaderboard) -> list[int]:
    """Give the patients of a board's group; those just chosen, while it is not saved."""
    chosen: list[int] | None = getattr(board, "chosen", None)
    if chosen is not None:
        return chosen
    return list(board.group.values_list("pk", flat=True)) if board.pk else []


def _read(board: Leaderboard, rows: QuerySet[SessionMetric], period: Period) -> Iterator[Walked]:
    """Give the sessions that count, patient by patient, each in the order of time."""
    rows = rows.filter(session__state=State.FINISHED.value, session__started_at__isnull=False)
    rows = rows.filter(session__excluded=False)
    if not board.include_simulated:
        rows = rows.filter(session__simulated=False)
    if board.types != Leaderboard.Types.ALL or {board.metric, board.tie_breaker} & TYPED:
        rows = rows.filter(session__changed_to="")  # one of several types is of none
    if board.slugs:
        rows = rows.alias(kind=Cast("session__valence", CharField()))
        rows = rows.filter(kind__in=board.slugs)
    if period.began is not None:
        rows = rows.filter(session__started_at__gte=period.began)
    if period.ended is not None:
        rows = rows.filter(session__started_at__lt=period.ended)
    wanted = {board.metric, board.tie_breaker, "steps", "active_minutes"} - {""}
    facts = ["session_id", "session__patient_id", "session__valence", "session__started_at"]
    facts += ["slug", "value"]
    if {board.metric, board.tie_breaker} & TYPED:
        facts.append("session__plan__valence__miss_points")
    # Types and slugs are cast so that SQLite does not choose their indexes: these lead through
    # everybody's sessions and figures, where those of some patients are wanted.
    ordered = (
        rows.alias(what=Cast("slug", CharField()))
        .filter(what__in=wanted)
        .order_by("session__patient_id", "session__started_at", "session_id")
        .values_list(*facts)
    )
    for (session_id, patient_id, valence, at), same in groupby(
        ordered.iterator(10_000), key=lambda row: row[:4]
    ):
        own: list[Any] = list(same)
        values = {row[4]: row[5] for row in own}
        if board.metric in values and counts(board, values):
            cost = -(own[0][6] or 0) if len(facts) > 6 else 0
            day = period.day_of(at)
            walked = Walked(session_id, patient_id, valence, at, day, values, cost)
            if not keeps(board.metric, valence) or measure(walked, board.metric)[1] > 0:
                yield walked


def counts(board: Leaderboard, values: dict[str, float]) -> bool:
    """Whether a session was long enough."""
    if values.get("steps", 0) >= board.min_valid_strides:
        return True
    return board.min_minutes is not None and values.get("active_minutes", 0) >= board.min_minutes


def measure(walked: Walked, slug: str) -> tuple[float, float]:
    """Give a session's figure in the unit that is shown, and what could be kept of it (or 0).

    Of what was lost nothing is told where it is not known what was at stake: imported sessions have
    points, and may have no steps.
    """
    value = walked.values.get(slug, 0.0) * (100 if slug in SHARES else 1)
    if not keeps(slug, walked.valence):
        return value, 0.0
    steps = 100 if slug == "points_per_100_steps" else walked.values.get("steps", 0)
    stake = walked.cost * steps
    return (stake + value if stake else 0.0), stake


def keeps(slug: str, valence: str) -> bool:
    """Whether points of this type are told as kept: they can only be lost."""
    known = VALENCES.get(valence)
    return slug in TYPED and known is not None and known.has_points and not known.rewards


def sum_up(board: Leaderboard, valence: str, walks: list[Walked], period: Period) -> Figure:
    """Give the row that a patient's sessions make: the best, the latest, a mean or a sum."""
    match board.entry:
        case Leaderboard.Entry.BEST:
            rows = [make_figure(board, valence, [walked], period) for walked in walks]
            return max(rows, key=lambda row: row.key)
        case Leaderboard.Entry.MEAN:
            walks = walks[-board.mean_of :]
        case Leaderboard.Entry.LATEST:
            walks = walks[-1:]
    return make_figure(board, valence, walks, period)


def make_figure(
    board: Leaderboard, valence: str, walks: Sequence[Walked], period: Period
) -> Figure:
    """Make one row of some sessions, by their mean or their sum. Figures are whole, as shown."""
    add = board.entry == Leaderboard.Entry.SUM
    value = combine(((w.day, measure(w, board.metric)[0]) for w in walks), board.metric, add)
    stake = combine(((w.day, measure(w, board.metric)[1]) for w in walks), board.metric, add)
    tie = 0
    if board.tie_breaker:
        broken = ((w.day, measure(w, board.tie_breaker)[0]) for w in walks)
        tie = combine(broken, board.tie_breaker, add)
    last = walks[-1]
    return Figure(
        patient_id=last.patient_id,
        session_id=last.session_id,
        valence=board.list_of(valence),
        value=value,
        stake=stake if keeps(board.metric, last.valence) else None,
        key=make_key(value if board.higher_is_better else -value, tie, last.at, last.session_id),
        stale_on=period.leaves(min(walked.day for walked in walks)),
    )


def combine(parts: Iterable[tuple[date, float]], slug: str, add: bool) -> int:
    """Join figures of some days to a whole one: their sum, no day above its most, or their mean."""
    days: dict[date, float] = defaultdict(float)
    count = 0
    for day, value in parts:
        days[day] += value
        count += 1
    if add:
        total = sum(min(value, MOST_A_DAY.get(slug, value)) for value in days.values())
    else:
        total = sum(days.values()) / count
    return max(-MOST, min(MOST, round(total)))


def make_key(merit: int, tie: int, at: datetime, session_id: int) -> str:
    """Write what a row is ordered by as digits: merit, tie-breaker, the earlier date.

    The session's number at the end makes every key another one, so that no order is by chance.
    """
    earlier = 10**10 - int(at.timestamp())
    return f"{merit + MOST:010d}{tie + MOST:010d}{earlier:011d}{10**12 - session_id:013d}"
