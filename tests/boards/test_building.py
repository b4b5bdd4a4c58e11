"""Boards of many patients are built beside everything else, and not shown before that is done."""

from __future__ import annotations

import threading
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.core.management import call_command
from django.db.models import Sum
from django.test import Client
from django.urls import reverse

from rehab.boards.building import entries, scheduler
from rehab.boards.building.scheduler import BoardBuilder
from rehab.boards.models import Leaderboard
from rehab.boards.panels.viewer import make_session_panels, make_waiting_panels
from rehab.boards.rows import BoardCount, BoardEntry
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from tests.support.walks import strides, walk
from tests.support.world import NOW, agreeing

PEOPLE = 9


@pytest.fixture
def woken(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Leave more than four patients to the thread, and record who wakes it."""
    calls: list[bool] = []
    monkeypatch.setattr(scheduler, "MAX_INLINE", 4)
    monkeypatch.setattr(scheduler.board_builder, "wake", lambda: calls.append(True))
    return calls


def _walk_all() -> list[TrainingSession]:
    clinic = Clinic.everywhere.create(name="Elm")
    people = [
        agreeing(
            Patient.everywhere.create(
                clinic=clinic,
                code=f"C-{n}",
                nickname=f"N-{n}",
                paretic_side="left",
                boards="clinic",
            )
        )
        for n in range(PEOPLE)
    ]
    return [walk(one, "positive", strides(20 - n, n)) for n, one in enumerate(people)]


@pytest.fixture(scope="class")
def _walked(keep: Callable[[Any], Any]) -> Callable[[], list[TrainingSession]]:
    made: Callable[[], list[TrainingSession]] = keep(_walk_all)
    return made


@pytest.fixture
def sessions(_walked: Callable[[], list[TrainingSession]], db: None, woken: list[bool]) -> Any:
    return _walked()


def make_board(session: TrainingSession, **fields: object) -> Leaderboard:
    how = {"among": "clinic", "aggregation": "best", "min_valid_strides": 1, "period": "all"}
    board = Leaderboard(clinic=session.clinic, **{"name": "Board"} | how | fields)
    board.full_clean()
    board.save()
    return board


def stored() -> tuple[list[tuple[object, ...]], list[tuple[object, ...]]]:
    rows = BoardEntry.everywhere.values_list("patient", "valence", "figure", "key")
    return sorted(rows), sorted(BoardCount.everywhere.values_list("valence", "figure", "rows"))


def build(board: Leaderboard, most: int = 2) -> int:
    batches = 1
    while entries.build_next(board.pk, most, NOW):
        batches += 1
    return batches


def test_a_board_of_many_is_not_built_in_the_request_and_not_shown_until_it_is(sessions):
    board = make_board(sessions[0])
    assert Leaderboard.everywhere.get().is_being_built
    assert not BoardEntry.everywhere.exists()
    (shown,) = make_session_panels(sessions[1], NOW)
    assert shown.note == "This board is being built. These are your own sessions."
    assert [row.you for row in shown.rows] == [True]
    assert build(board) == PEOPLE // 2 + 1
    (shown,) = make_session_panels(sessions[1], NOW)
    assert shown.shared
    assert not shown.note
    kept = stored()
    assert len(kept[0]) == PEOPLE
    call_command("rebuildboards", verbosity=0)
    assert stored() == kept


def test_a_waiting_tablet_shows_none_that_is_being_built(sessions):
    board = make_board(sessions[0], occasion="waiting", display="top", types="all")
    assert make_waiting_panels(board.clinic, NOW) == []
    build(board)
    assert len(make_waiting_panels(board.clinic, NOW)) == 1


def test_a_look_wakes_a_builder_that_was_stopped(sessions, woken):
    make_board(sessions[0])
    assert not woken  # nothing is built before the commit
    make_session_panels(sessions[1], NOW)
    assert woken


def test_what_fails_half_way_goes_on_where_it_was(sessions, monkeypatch):
    board = make_board(sessions[0])
    entries.build_next(board.pk, 4, NOW)
    kept = stored()
    with monkeypatch.context() as patch:
        patch.setattr(entries, "_add_to_counts", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            entries.build_next(board.pk, 4, NOW)
    assert stored() == kept
    assert build(board) == (PEOPLE - 4) // 2 + 1
    built = stored()
    entries.refresh(board, now=NOW)
    assert stored() == built


def test_what_happens_to_patients_meanwhile_is_kept_up(sessions):
    board = make_board(sessions[0])
    entries.build_next(board.pk, 4, NOW)
    for session in (sessions[1], sessions[7]):  # one behind and one ahead
        walk(session.patient, "positive", strides(1, 30), days_ago=-1)
        session.patient.boards = "own"
        session.patient.save()
    for session in (sessions[0], sessions[8]):
        walk(session.patient, "positive", strides(40, 0), days_ago=-1)
    build(board)
    built = stored()
    assert len(built[0]) == PEOPLE - 2
    entries.refresh(board, now=NOW + timedelta(days=2))
    assert stored() == built
    assert BoardCount.everywhere.aggregate(rows=Sum("rows"))["rows"] == PEOPLE - 2


def test_another_measure_or_group_is_another_board(sessions):
    board = make_board(sessions[0])
    build(board)
    by_hits = stored()
    board.metric = "steps"
    board.save()
    assert board.is_being_built
    build(board)
    assert stored() != by_hits
    board.refresh_from_db()
    board.among = "self"
    board.aggregation = "each"
    board.save()
    build(board)
    assert stored() == ([], [])


def test_how_a_board_is_shown_alters_no_row_and_hides_nothing(sessions, woken):
    board = make_board(sessions[0], types="all")
    first = Leaderboard.everywhere.get()  # as a form read it, before anything was built
    entries.build_next(board.pk, 4, NOW)
    first.name, first.top_n, first.occasion, first.display = "Renamed", 3, "waiting", "top"
    first.save()
    build(board)
    built = stored()
    woken.clear()
    for name, value in (("show_ranks", False), ("ties", "dense"), ("names", "code")):
        board = Leaderboard.everywhere.get()
        setattr(board, name, value)
        board.save()
        assert not Leaderboard.everywhere.get().is_being_built
    assert stored() == built
    entries.refresh(board, now=NOW)
    assert stored() == built
    assert not woken


def test_a_clinics_other_settings_hide_no_board(sessions):
    Clinic.everywhere.update(boards_across=True)
    clinic = Clinic.everywhere.get()
    Patient.everywhere.update(boards="across")
    across = Leaderboard(
        name="Across", among="across", aggregation="best", types="all", min_valid_strides=1
    )
    across.save()
    boards = [across, make_board(sessions[0])]
    for board in boards:
        build(board)
    clinic.log_retention_months, clinic.name = 40, "Yew"
    clinic.save()
    assert entries.find_unbuilt() is None
    clinic.time_zone = "Asia/Tokyo"
    clinic.save()
    assert entries.find_unbuilt() == boards[1].pk
    assert not Leaderboard.everywhere.get(pk=across.pk).is_being_built
    build(boards[1])
    clinic.boards_across = False
    clinic.save()
    assert entries.find_unbuilt() == across.pk
    assert not Leaderboard.everywhere.get(pk=boards[1].pk).is_being_built


def test_of_a_group_only_those_are_made_anew_who_come_or_go(sessions, monkeypatch):
    people = [session.patient for session in sessions]
    board = make_board(sessions[0], among="group")
    build(board)
    made: list[set[int]] = []
    real = entries.refresh

    def refresh(board, patients=None, **how):
        made.append(patients)
        real(board, patients, **how)

    monkeypatch.setattr(entries, "refresh", refresh)
    board.group.set(people[:4])
    board.group.set(people[1:5])
    assert made == [{one.pk for one in people[:4]}, {people[0].pk}, {people[4].pk}]
    kept = stored()
    assert [row[0] for row in kept[0]] == [one.pk for one in people[1:5]]
    real(board, now=NOW)
    assert stored() == kept
    board.group.set(people)  # five are many: they are built beside
    assert len(made) == 3
    assert entries.find_unbuilt() == board.pk


def test_many_rows_of_another_day_are_made_beside_and_not_shown_meanwhile(sessions, woken):
    board = make_board(sessions[0], period="days_30", types="all")
    later = NOW + timedelta(days=30)
    people = [session.patient for session in sessions]
    build(board)
    for person in people[:6]:
        walk(person, "positive", strides(9, 1), days_ago=-20)
    (shown,) = make_session_panels(sessions[1], later)
    assert shown.note == "This board is being built. These are your own sessions."
    assert woken
    assert len(entries.find_stale(board, later, 99)) == 6  # of three the best session is new
    assert entries.find_outdated(later, 4) == board.pk
    while entries.refresh_stale(board.pk, 2, later):
        pass
    kept = stored()
    assert len(kept[0]) == 6
    assert make_session_panels(sessions[1], later)[0].shared
    entries.refresh(board, now=later)
    assert stored() == kept


def test_a_few_rows_of_another_day_are_made_in_the_look(sessions, woken):
    board = make_board(sessions[0], period="days_30", types="all")
    build(board)
    for session in sessions[:5]:
        session.patient.boards = "own"
        session.patient.save()
    woken.clear()
    make_session_panels(sessions[8], NOW + timedelta(days=30))
    assert stored() == ([], [])
    assert not woken


def test_the_thread_catches_up_with_the_calendar(transactional_db, sessions):
    board = make_board(sessions[0])
    build(board)
    kept = stored()
    BoardEntry.everywhere.update(stale_on=NOW.date() - timedelta(days=1), figure=1)
    BoardCount.everywhere.all().delete()
    BoardCount.everywhere.create(board=board, valence="positive", figure=1, rows=PEOPLE)
    builder = BoardBuilder()
    builder.wake()
    while (thread := builder._thread) is not None:
        thread.join(20)
    assert stored() == kept


def test_counts_that_went_wrong_are_mended(sessions):
    board = make_board(sessions[0])
    build(board)
    built = stored()
    BoardCount.everywhere.update(rows=77)
    entries.refresh(board, now=NOW)
    assert stored() == built


def test_a_board_that_is_deleted_while_it_is_built(sessions):
    board = make_board(sessions[0])
    entries.build_next(board.pk, 4, NOW)
    Leaderboard.everywhere.all().delete()
    assert not entries.build_next(board.pk, 4, NOW)
    assert entries.find_unbuilt() is None


def test_the_form_says_how_far_it_is(sessions):
    board = make_board(sessions[0])
    entries.build_next(board.pk, 3, NOW)
    browser = Client()
    lead = User.everywhere.create_user("lead", role=Role.LEAD, clinic=board.clinic)
    browser.force_login(lead)
    address = reverse("admin:rehab_leaderboard_change", kwargs={"object_id": board.pk})
    assert "is being built: 33 %" in browser.get(address).content.decode()
    build(board)
    assert "is being built" not in browser.get(address).content.decode()


@pytest.mark.django_db(transaction=True)
def test_the_thread_builds_all_that_is_to_be_built_and_ends(sessions):
    boards = [make_board(sessions[0], name=f"Board {n}") for n in range(2)]
    builder = BoardBuilder()
    builder.wake()
    builder.wake()
    thread = builder._thread
    assert thread is not None
    thread.join(20)
    assert not thread.is_alive()
    assert builder._thread is None
    assert not Leaderboard.everywhere.filter(built_to__isnull=False).exists()
    assert BoardEntry.everywhere.count() == 2 * PEOPLE
    boards[0].metric = "steps"
    boards[0].save()
    builder.stop()
    builder.wake()  # the server is stopping: the next one goes on
    assert not [one for one in threading.enumerate() if one.name == "garry-boards"]
    assert Leaderboard.everywhere.filter(built_to=0).count() == 1


@pytest.mark.django_db(transaction=True)
def test_trouble_ends_the_thread_and_the_next_look_begins_again(sessions, monkeypatch, caplog):
    make_board(sessions[0])
    builder = BoardBuilder()
    with monkeypatch.context() as patch:
        patch.setattr(entries, "build_next", lambda *_: 1 / 0)
        builder.wake()
        while (thread := builder._thread) is not None:
            thread.join(20)
    assert "A board could not be built" in caplog.text
    builder.wake()
    while (thread := builder._thread) is not None:
        thread.join(20)
    assert entries.find_unbuilt() is None
