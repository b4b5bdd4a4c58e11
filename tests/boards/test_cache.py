"""Cached standings are those that another server computes, after whatever changed."""

from __future__ import annotations

import threading
from collections import Counter
from typing import Any

import pytest
from django.db import connection, transaction
from django.test.utils import CaptureQueriesContext
from hypothesis import given
from hypothesis import strategies as st

from rehab.boards import cache
from rehab.boards.cache import read_lists
from rehab.boards.cache_invalidation import BoardChange, delete_old_changes
from rehab.boards.choices import DisplayMode, TieRule
from rehab.boards.models import Leaderboard
from rehab.boards.ranking import results
from rehab.boards.ranking.anonymity import cutoff_rank, find_visible_rows
from rehab.boards.ranking.results import Result, make_key
from rehab.boards.ranking.standings import Standings
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.sessions.corrections import CorrectedField, correct_session
from rehab.sessions.models import TrainingSession
from tests.support.boards import (
    all_rows,
    board_of,
    figures_of,
    patient_of,
    people_of,
    rows_computed_anew,
    walk_down,
)
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


@pytest.mark.wide
def test_cached_rows_are_those_computed_anew(clinic):
    for number, fields in enumerate(
        (
            {},
            {"types": "all", "metric": "best_streak", "aggregation": "latest"},
            {"metric": "score", "aggregation": "mean"},
            {"types": "all", "metric": "active_minutes", "aggregation": "sum", "period": "days_30"},
        )
    ):
        board_of(clinic, **{"name": f"Board {number}"} | fields)
    people = people_of(clinic, 6)
    lead = User.everywhere.create_user("lead", role=Role.LEAD, clinic=clinic)

    def correct(session: TrainingSession, **changes: str) -> None:
        found = {CorrectedField(field): value for field, value in changes.items()}
        correct_session(session, found, "Wrong.", lead, NOW)

    def leave() -> None:
        people[0].boards = "own"
        people[0].save()

    sessions = walk_down(people, "negative", days_ago=3)
    for change in (
        lambda: walk_down(people, "positive", days_ago=3),
        lambda: walk_down(people, "explicit", days_ago=3),
        lambda: walk_down(people[::-1], "positive"),
        leave,
        lambda: correct(sessions[1], counts="no"),
        lambda: correct(sessions[2], patient=people[3].pseudonym),
    ):
        before = all_rows()
        change()
        cached = all_rows()
        assert cached != before
        assert cached == rows_computed_anew()
    assert sum(map(len, cached.values())) > 30


def test_only_the_patients_concerned_are_computed_anew(clinic, monkeypatch):
    board = board_of(clinic)
    people = people_of(clinic, 6)
    walk_down(people)
    assert len(figures_of(board)) == 6
    read: list[Any] = []
    real = results.read_results

    def read_results(board: Leaderboard, *how: Any) -> Any:
        read.append(how[1:])
        return real(board, *how)

    monkeypatch.setattr(cache, "read_results", read_results)
    walk(people[5], "positive", strides(30, 0))
    assert next(iter(figures_of(board))) == people[0].pk
    assert figures_of(board)[people[5].pk] == 100
    assert read == [({people[5].pk},)]


def test_what_was_rolled_back_is_on_no_board(clinic):
    board = board_of(clinic)
    walk_down(people_of(clinic, 5))
    before = figures_of(board)
    with transaction.atomic():
        walk(patient_of(clinic, "A"), "positive", strides(1, 0))
        assert len(figures_of(board)) == 6  # by this transaction's own look
        transaction.set_rollback(True)
    assert figures_of(board) == before


def test_readers_at_the_same_time_compute_a_board_once(clinic, monkeypatch):
    board = board_of(clinic)
    started, release, computed = threading.Event(), threading.Event(), []

    def read_results(*_: Any) -> list[Result]:
        computed.append(True)
        started.set()
        assert release.wait(5)
        return []

    monkeypatch.setattr(cache, "read_results", read_results)
    monkeypatch.setattr(cache, "read_changes", lambda *_: {})
    monkeypatch.setattr(cache, "_find_simulated", lambda *_: set())
    readers = [threading.Thread(target=read_lists, args=(board, NOW)) for _ in range(3)]
    readers[0].start()
    assert started.wait(5)
    for reader in readers[1:]:
        reader.start()
    release.set()
    for reader in readers:
        reader.join(5)
    assert computed == [True]


def test_changes_are_deleted_once_no_cache_reads_them(clinic):
    patient_of(clinic, "A")
    assert BoardChange.everywhere.exists()
    delete_old_changes(NOW)
    assert BoardChange.everywhere.exists()
    BoardChange.everywhere.update(at=NOW.replace(year=NOW.year - 1))
    delete_old_changes(NOW)
    assert not BoardChange.everywhere.exists()


def test_a_patients_rows_are_computed_from_no_other_patients_sessions(clinic):
    """SQLite knows nothing of how many there are unless somebody tells it."""
    board = board_of(clinic, types="chosen", period="week", metric="score", valences=["positive"])
    person = patient_of(clinic, "A")
    figures_of(board)
    walk(person, "positive", strides(9, 1))
    with CaptureQueriesContext(connection) as asked:
        figures_of(board)
    (query,) = [one["sql"] for one in asked.captured_queries if "sessionmetric" in one["sql"]]
    if connection.vendor == "sqlite":
        with connection.cursor() as cursor:
            cursor.execute(f"EXPLAIN QUERY PLAN {query}")
            plan = "; ".join(row[3] for row in cursor.fetchall())
        assert "SCAN" not in plan, plan
        assert "(patient_id=?)" in plan
        assert "metric_by_value" not in plan


@pytest.mark.wide
@given(
    st.lists(st.integers(0, 6), min_size=1, max_size=14),
    st.lists(st.integers(0, 6), max_size=3),
    st.sampled_from(TieRule),
)
def test_ranks_follow_from_the_figures(figures, later, ties):
    clinic = Clinic(pk=1, name="Ash")
    board = Leaderboard(clinic=clinic, name="B", among="clinic", ties=ties)

    def result(patient: int, figure: int) -> Result:
        return Result(patient, patient, "", figure, None, make_key(figure, 0, NOW, patient))

    standings = Standings([result(*each) for each in enumerate(figures)], ties)
    changed = dict(enumerate(later))
    before = standings.top(99)
    standings.replace(changed, [result(*each) for each in changed.items()], ())
    assert standings.top(99) == before
    standings = standings.replace(changed, [result(*each) for each in changed.items()], ())
    now = dict(enumerate(figures)) | changed
    assert (standings.count, standings.total) == (len(now), sum(now.values()))
    rows = standings.top(99)
    assert [row.patient_id for row in rows] == sorted(now, key=lambda pk: (-now[pk], pk))
    for place, row in enumerate(rows, start=1):
        better = [figure for figure in now.values() if figure > row.figure]
        assert row == standings.find(row.patient_id)
        assert row.shared_rank == 1 + len(better)
        assert (
            row.rank
            == {
                TieRule.STANDARD: 1 + len(better),
                TieRule.DENSE: 1 + len(Counter(better)),
                TieRule.EARLIER: place,
            }[ties]
        )
        assert standings.around(row, 2) == rows[max(0, place - 3) : place + 2]
        for display in DisplayMode:
            board.display = display
            chosen = find_visible_rows(board, standings, row)
            half = (len(now) + 1) // 2
            assert all(cutoff_rank(board, each.row) <= half or each.row == row for each in chosen)
            assert not [c for c in chosen if c.has_rank and cutoff_rank(board, c.row) > half]


def test_the_boards_read_last_are_cached_and_as_many_as_it_says():
    cache.clear_cache()
    first, second, *_ = kept = [cache._find_cached(key) for key in range(cache.MAX_BOARDS)]
    assert [cache._find_cached(key) for key in range(cache.MAX_BOARDS)] == kept
    assert cache._find_cached(0) is first  # now the second one was read longest ago
    cache._find_cached("one more")
    assert cache._find_cached(0) is first
    assert cache._find_cached(1) is not second
    cache.clear_cache()
