"""The standings of boards of several patients, computed when they are read and cached.

Each server process has a cache of its own. Every read compares it with the changes that are stored
(`changes.py`) and recomputes the patients concerned, so that all processes show the same at once.
"""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field
from datetime import date, datetime
from threading import Lock

from django.utils import timezone

from rehab.boards.cache_invalidation import read_changes
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.eligibility import eligible_patients, find_group
from rehab.boards.ranking.periods import period_of
from rehab.boards.ranking.results import Result, read_results
from rehab.boards.ranking.standings import Standings
from rehab.boards.snapshots import find_version, read_snapshot
from rehab.people.models import Clinic

MAX_BOARDS = 64  # a process; those that were read last

Lists = dict[str, Standings]  # by the valence that a list is for; "" for all


@dataclass
class _Cached:
    """The standings of one board, with the changes that they contain.

    The lock makes other readers wait while they are computed.
    """

    lists: Lists | None = None
    changes: frozenset[int] = frozenset()
    lock: Lock = field(default_factory=Lock)


_cache: OrderedDict[Hashable, _Cached] = OrderedDict()
_cache_lock = Lock()


def clear_cache() -> None:
    """Remove all cached standings."""
    with _cache_lock:
        _cache.clear()


def read_standings(board: Leaderboard, valence: str, now: datetime) -> Standings:
    """Return the standings of one list of a board."""
    found = read_lists(board, now).get(board.list_key(valence))
    return Standings((), board.ties) if found is None else found


def read_lists(board: Leaderboard, now: datetime) -> Lists:
    """Return all lists of a board; of a frozen one, those of its snapshot.

    The board may be a form that is not saved.
    """
    version = find_version(board, now)
    if version is None:
        today = timezone.now().date()  # by the clock that dates changes, in UTC
        cached = _find_cached((*_key_of(board, now), today))
        with cached.lock:
            return _update(cached, board, now, today)
    cached = _find_cached((version, board.ties))
    with cached.lock:
        if cached.lists is None:
            cached.lists = _rank(board, read_snapshot(version))
        return cached.lists


def _key_of(board: Leaderboard, now: datetime) -> tuple[Hashable, ...]:
    """Return what standings depend on besides patients and sessions."""
    clinics: Iterable[int] = [board.clinic_id or 0]
    if board.clinic_id is None:
        taking_part = Clinic.everywhere.filter(boards_across=True).order_by("pk")
        clinics = taking_part.values_list("pk", flat=True)
    group = find_group(board) if board.has_group else ()
    period = period_of(board, now)
    return (tuple(clinics), board.definition, board.ties, frozenset(group), period)


def _find_cached(key: Hashable) -> _Cached:
    with _cache_lock:
        cached = _cache.setdefault(key, _Cached())
        _cache.move_to_end(key)
        while len(_cache) > MAX_BOARDS:
            _cache.popitem(last=False)
        return cached


def _update(cached: _Cached, board: Leaderboard, now: datetime, today: date) -> Lists:
    """Return the lists: computed anew, or for the patients who have changed since then.

    Changes are read before anything else: what changes later is recomputed by the next reader.
    """
    changes = read_changes(board, today)
    tokens = frozenset(changes)
    if cached.lists is None or not cached.changes <= tokens:  # a change was rolled back
        cached.lists = _rank(board, read_results(board, now))
    elif patients := {changes[token] for token in tokens - cached.changes}:
        lists: dict[str, list[Result]] = defaultdict(list)
        for result in read_results(board, now, patients):
            lists[result.valence].append(result)
        simulated = _find_simulated(board, patients)
        empty = Standings((), board.ties)
        cached.lists = {
            valence: cached.lists.get(valence, empty).replace(patients, lists[valence], simulated)
            for valence in {*cached.lists, *lists}
        }
    cached.changes = tokens
    return cached.lists


def _rank(board: Leaderboard, results: Iterable[Result]) -> Lists:
    lists: dict[str, list[Result]] = defaultdict(list)
    for result in results:
        lists[result.valence].append(result)
    simulated = _find_simulated(board)
    return {valence: Standings(rows, board.ties, simulated) for valence, rows in lists.items()}


def _find_simulated(board: Leaderboard, among: Iterable[int] | None = None) -> set[int]:
    """Return the simulated patients on a board."""
    patients = eligible_patients(board).filter(simulated=True)
    if among is not None:
        patients = patients.filter(pk__in=among)
    return set(patients.values_list("pk", flat=True))
