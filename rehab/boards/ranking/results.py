"""A patient's result on a board: the figure of the row, and the key that orders it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from datetime import date, datetime
from itertools import groupby
from typing import NamedTuple

from rehab.boards.choices import Aggregation
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.counted_sessions import CountedSession, is_kept, read_sessions
from rehab.boards.ranking.eligibility import eligible_patients
from rehab.boards.ranking.periods import period_of
from rehab.sessions.models import TrainingSession

# The most that one day adds to a sum, so that no board tempts a patient to overdo it.
MAX_PER_DAY = {"active_minutes": 60.0, "target_met": 1.0}

Key = tuple[int, ...]  # see `make_key`


class Result(NamedTuple):
    """A patient's row before it is ranked.

    Attributes
    ----------
    figure
        As it is shown: a whole number.
    points_at_stake
        The points that could be kept; None where points are not only lost.
    key
        What rows are ordered by: the smaller, the better.
    """

    patient_id: int
    session_id: int
    valence: str
    figure: int
    points_at_stake: int | None
    key: Key


def read_results(
    board: Leaderboard, now: datetime, patients: Collection[int] | None = None
) -> Iterator[Result]:
    """Yield the results on a board of several patients: one for each patient and list.

    ``patients`` narrows the eligible ones to these.
    """
    eligible = eligible_patients(board)
    if patients is not None:
        eligible = eligible.filter(pk__in=patients)
    walked = TrainingSession.everywhere.filter(patient__in=eligible)
    sessions = read_sessions(board, walked, period_of(board, now))
    for _, group in groupby(sessions, key=lambda session: session.patient_id):
        lists: dict[str, list[CountedSession]] = defaultdict(list)
        for session in group:
            lists[board.list_key(session.valence)].append(session)
        for valence, own in lists.items():
            yield aggregate(board, valence, own)


def own_results(
    board: Leaderboard, sessions: Iterable[CountedSession], valence: str
) -> list[Result]:
    """Return the results of one patient's own sessions, in no order.

    One for each session in the list of a valence; on a board that adds up, their sum.
    """
    own = [
        session
        for session in sessions
        if board.list_key(session.valence) == board.list_key(valence) and session.counts_for(board)
    ]
    if board.aggregation == Aggregation.SUM:
        return [aggregate(board, valence, own)] if own else []
    return [make_result(board, valence, [session]) for session in own]


def aggregate(board: Leaderboard, valence: str, sessions: list[CountedSession]) -> Result:
    """Return the result of a patient's sessions: their best, latest, mean or sum."""
    match board.aggregation:
        case Aggregation.BEST:
            results = [make_result(board, valence, [session]) for session in sessions]
            return min(results, key=lambda result: result.key)
        case Aggregation.MEAN:
            sessions = sessions[-board.mean_of :]
        case Aggregation.LATEST:
            sessions = sessions[-1:]
    return make_result(board, valence, sessions)


def make_result(board: Leaderboard, valence: str, sessions: Sequence[CountedSession]) -> Result:
    """Return the result of some sessions: the sum or the mean of their figures."""

    def combined(slug: str, of: Callable[[CountedSession, str], float]) -> int:
        parts = ((session.day, of(session, slug)) for session in sessions)
        return combine(parts, slug, add=board.aggregation == Aggregation.SUM)

    figure = combined(board.metric, CountedSession.figure)
    at_stake = combined(board.metric, CountedSession.points_at_stake)
    tie = combined(board.tie_breaker, CountedSession.figure) if board.tie_breaker else 0
    last = sessions[-1]
    merit = figure if board.higher_is_better else -figure
    return Result(
        patient_id=last.patient_id,
        session_id=last.session_id,
        valence=board.list_key(valence),
        figure=figure,
        points_at_stake=at_stake if is_kept(board.metric, last.valence) else None,
        key=make_key(merit, tie, last.at, last.session_id),
    )


def combine(parts: Iterable[tuple[date, float]], slug: str, *, add: bool) -> int:
    """Return the mean of the figures of some days or (``add``) their sum, as a whole number.

    In a sum no day counts more than ``MAX_PER_DAY``.
    """
    days: dict[date, float] = defaultdict(float)
    count = 0
    for day, value in parts:
        days[day] += value
        count += 1
    if add:
        total = sum(min(value, MAX_PER_DAY.get(slug, value)) for value in days.values())
    else:
        total = sum(days.values()) / count
    return round(total)


def make_key(merit: int, tie: int, at: datetime, session_id: int) -> Key:
    """Return what a row is ordered by: merit, tie-breaker, the earlier time.

    The session's key at the end makes every key unique, so that no order is by chance.
    """
    return (-merit, -tie, int(at.timestamp()), session_id)
