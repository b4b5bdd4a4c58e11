"""Rows of boards follow from sessions: kept up, made anew, or beside whatever else changes."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.management import call_command
from django.db import connection
from django.test.utils import CaptureQueriesContext
from hypothesis import given, settings
from hypothesis import strategies as st

from rehab.boards.building import entries
from rehab.boards.choices import DisplayMode, TieRule
from rehab.boards.models import Leaderboard
from rehab.boards.panels.viewer import make_session_panels
from rehab.boards.ranking.standings import ComputedStandings, StoredStandings
from rehab.boards.ranking.visibility import cutoff_rank, find_visible_rows
from rehab.boards.rows import BoardCount, BoardEntry
from rehab.people.models import Clinic, Patient
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from tests.support.boards import COMMON, board_of, everything, patient_of, people_of, walk_down
from tests.support.extent import examples
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


@pytest.mark.wide
def test_rows_that_were_kept_up_are_those_that_are_made_anew(clinic):
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
    for valence in ("positive", "negative", "binary", "explicit"):
        walk_down(people, valence, days_ago=3)
    walk_down(people[::-1], "positive")
    people[0].boards = "own"
    people[0].save()
    gone = TrainingSession.everywhere.filter(patient=people[1]).last()
    gone.steps.all().delete()
    gone.events.all().delete()
    gone.delete()
    figure = SessionMetric.everywhere.filter(session__patient=people[2], slug="hit_rate").first()
    figure.value = 0.01
    figure.save()
    kept = everything()
    assert len(kept[0]) > 30
    BoardCount.everywhere.all().delete()
    BoardEntry.everywhere.all().delete()
    call_command("rebuildboards", verbosity=0)
    assert everything() == kept


def test_trouble_with_boards_loses_no_step(clinic, monkeypatch, caplog):
    board_of(clinic)
    person = patient_of(clinic, "A")
    monkeypatch.setattr(entries, "read_results", lambda *_: 1 / 0)
    session = walk(person, "positive", strides(3, 1))
    assert session.state == "finished"
    assert session.steps.count() == 4
    assert "rebuildboards" in caplog.text
    monkeypatch.undo()
    call_command("rebuildboards", verbosity=0)
    assert BoardEntry.everywhere.get().figure == 75


def test_boards_that_did_not_follow_heal_by_themselves(
    clinic, monkeypatch, caplog, django_capture_on_commit_callbacks
):
    board = board_of(clinic)
    frozen = board_of(clinic, name="Frozen", frozen_on=NOW.date() - timedelta(days=5))
    people = people_of(clinic, 6)
    sessions = walk_down(people)
    with monkeypatch.context() as patch, django_capture_on_commit_callbacks(execute=True):
        patch.setattr(entries, "read_results", lambda *_: 1 / 0)
        walk(people[5], "positive", strides(20, 0), days_ago=1)
    assert "Boards could not be updated" in caplog.text
    assert entries.find_unbuilt() == board.pk
    assert not Leaderboard.everywhere.get(pk=frozen.pk).is_being_built
    told = {shown.title: shown.note for shown in make_session_panels(sessions[0], NOW)}
    assert told["Board"] == "This board is being built. These are your own sessions."
    while entries.build_next(board.pk, 50, NOW):
        pass
    assert BoardEntry.everywhere.get(board=board, patient=people[5]).figure == 100
    assert sum(BoardCount.everywhere.values_list("rows", flat=True)) == 6


def test_rows_are_those_of_the_board_as_it_is_not_as_it_was_read(clinic):
    board_of(clinic, types="all")
    person = patient_of(clinic, "A")
    walk(person, "positive", strides(9, 1))
    read = Leaderboard.everywhere.select_related("clinic").get()
    board = Leaderboard.everywhere.get()
    board.metric = "steps"
    board.save()
    entries.refresh(read, {person.pk}, now=NOW)
    assert BoardEntry.everywhere.get().figure == 10


def test_a_patients_rows_are_made_of_no_other_patients_figures(clinic):
    """SQLite knows nothing of how many there are unless somebody tells it."""
    board_of(clinic, types="chosen", period="week", metric="score", valences=["positive"])
    person = patient_of(clinic, "A")
    walk(person, "positive", strides(9, 1))
    with CaptureQueriesContext(connection) as asked:
        entries.refresh_patients({person.pk, *range(900, 960)}, now=NOW)
    (query,) = [one["sql"] for one in asked.captured_queries if "sessionmetric" in one["sql"]]
    if connection.vendor == "sqlite":
        with connection.cursor() as cursor:
            cursor.execute(f"EXPLAIN QUERY PLAN {query}")
            plan = "; ".join(row[3] for row in cursor.fetchall())
        assert "SCAN" not in plan, plan
        assert "(patient_id=?)" in plan
        assert "metric_by_value" not in plan


def test_everyone_locks_boards_in_one_order_and_each_once(clinic, monkeypatch):
    oak = Clinic.everywhere.create(name="Oak", boards_across=True)
    boards = [
        board_of(oak, name="a"),
        board_of(None, name="b", among="across"),
        board_of(clinic, name="c"),
        board_of(None, name="d", among="across"),
        board_of(oak, name="e"),
    ]
    both = {patient_of(clinic, "A", "across").pk, patient_of(oak, "B", "across").pk}
    locked: list[int] = []
    real = entries._lock

    def lock(board_id: int) -> Leaderboard | None:
        locked.append(board_id)
        return real(board_id)

    monkeypatch.setattr(entries, "_lock", lock)
    entries.refresh_patients(both, now=NOW)
    assert locked == [board.pk for board in boards]


@pytest.mark.wide
@settings(deadline=None, max_examples=examples(40))
@given(st.lists(st.integers(0, 6), min_size=1, max_size=14), st.sampled_from(TieRule))
def test_stored_and_counted_standings_are_the_same(figures, ties):
    clinic = Clinic.everywhere.get_or_create(name="Ash")[0]
    board = Leaderboard.everywhere.get_or_create(clinic=clinic, name="B", defaults=COMMON)[0]
    board.ties = ties
    with_rows = [
        Patient.everywhere.get_or_create(
            clinic=clinic, code=f"{n}", defaults={"boards": "clinic", "nickname": "N"}
        )[0]
        for n in range(len(figures))
    ]
    made = [make(person, figure) for person, figure in zip(with_rows, figures, strict=True)]
    BoardEntry.everywhere.filter(board=board).delete()
    BoardCount.everywhere.filter(board=board).delete()
    BoardEntry.everywhere.bulk_create(entries.make_entry(board, row) for row in made)
    BoardCount.everywhere.bulk_create(
        BoardCount(board=board, valence="", figure=f, rows=figures.count(f)) for f in set(figures)
    )
    listed, stored = ComputedStandings(board, made), StoredStandings(board, "")
    assert (listed.count, listed.total) == (stored.count, stored.total) == (len(made), sum(figures))
    assert plain(listed.top(5)) == plain(stored.top(5))
    for person in with_rows:
        mine, same = listed.find(person.pk), stored.find(person.pk)
        assert plain([mine]) == plain([same])
        assert plain(listed.around(mine, 2)) == plain(stored.around(same, 2))
        better = [figure for figure in figures if figure > mine.figure]
        assert mine.shared_rank == 1 + len(better)
        if ties == "dense":
            assert mine.rank == 1 + len(set(better))
        for display in DisplayMode:
            board.display = display
            chosen = find_visible_rows(board, stored, same)
            half = (len(made) + 1) // 2
            assert all(cutoff_rank(board, each.row) <= half or each.row == same for each in chosen)
            assert not [c for c in chosen if c.has_rank and cutoff_rank(board, c.row) > half]


def make(person: Patient, figure: int):
    from rehab.boards.ranking.results import Result, make_key

    key = make_key(figure, 0, NOW, person.pk)
    return Result(person.pk, person.pk, "", figure, None, key, None)


def plain(rows) -> list[tuple[int, int, int, int]]:
    return [(row.patient_id, row.figure, row.shared_rank, row.rank) for row in rows]
