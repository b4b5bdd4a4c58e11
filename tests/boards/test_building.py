"""Boards of many patients are built beside everything else, and not shown before that is done."""

from __future__ import annotations

import threading
from datetime import timedelta

import pytest
from django.core.management import call_command
from django.db.models import Sum
from django.test import Client
from django.urls import reverse

from rehab.boards import building, entries
from rehab.boards.building import Builder
from rehab.boards.models import BoardCount, BoardEntry, Leaderboard
from rehab.boards.showing import show_after, show_waiting
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from tests.walks import strides, walk
from tests.world import NOW, agreeing

PEOPLE = 9


@pytest.fixture
def woken(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Let more than four patients be many, and note who wakes the builder."""
    calls: list[bool] = []
    monkeypatch.setattr(building, "FEW", 4)
    monkeypatch.setattr(building.builder, "wake", lambda: calls.append(True))
    return calls


@pytest.fixture
def sessions(db: None, woken: list[bool]) -> list[TrainingSession]:
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


def make_board(session: TrainingSession, **fields: object) -> Leaderboard:
    how = {"among": "clinic", "entry": "best", "min_valid_strides": 1, "period": "all"}
    board = Leaderboard(clinic=session.clinic, **{"name": "Board"} | how | fields)
    board.full_clean()
    board.save()
    return board


def stored() -> tuple[list[tuple[object, ...]], list[tuple[object, ...]]]:
    rows = BoardEntry.everywhere.values_list("patient", "valence", "figure", "key")
    return sorted(rows), sorted(BoardCount.everywhere.values_list("valence", "figure", "rows"))


def build(board: Leaderboard, most: int = 2) -> int:
    batches = 1
    while entries.advance(board.pk, most, NOW):
        batches += 1
    return batches


def test_a_board_of_many_is_not_built_in_the_request_and_not_shown_until_it_is(sessions):
    board = make_board(sessions[0])
    assert Leaderboard.everywhere.get().is_being_built
    assert not BoardEntry.everywhere.exists()
    (shown,) = show_after(sessions[1], NOW)
    assert shown.note == "This board is being built. These are your own sessions."
    assert [row.you for row in shown.rows] == [True]
    assert build(board) == PEOPLE // 2 + 1
    (shown,) = show_after(sessions[1], NOW)
    assert shown.shared
    assert not shown.note
    kept = stored()
    assert len(kept[0]) == PEOPLE
    call_command("rebuildboards", verbosity=0)
    assert stored() == kept


def test_a_waiting_tablet_shows_none_that_is_being_built(sessions):
    board = make_board(sessions[0], moment="waiting", display="top", types="all")
    assert show_waiting(board.clinic, NOW) == []
    build(board)
    assert len(show_waiting(board.clinic, NOW)) == 1


def test_a_look_wakes_a_builder_that_was_stopped(sessions, woken):
    make_board(sessions[0])
    assert not woken  # nothing is built before the commit
    show_after(sessions[1], NOW)
    assert woken


def test_what_fails_half_way_goes_on_where_it_was(sessions, monkeypatch):
    board = make_board(sessions[0])
    entries.advance(board.pk, 4, NOW)
    kept = stored()
    with monkeypatch.context() as patch:
        patch.setattr(entries, "_count", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            entries.advance(board.pk, 4, NOW)
    assert stored() == kept
    assert build(board) == (PEOPLE - 4) // 2 + 1
    built = stored()
    entries.refresh(board, now=NOW)
    assert stored() == built


def test_what_happens_to_patients_meanwhile_is_kept_up(sessions):
    board = make_board(sessions[0])
    entries.advance(board.pk, 4, NOW)
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
    board.entry = "each"
    board.save()
    build(board)
    assert stored() == ([], [])


def test_counts_that_went_wrong_are_mended(sessions):
    board = make_board(sessions[0])
    build(board)
    built = stored()
    BoardCount.everywhere.update(rows=77)
    entries.refresh(board, now=NOW)
    assert stored() == built


def test_a_board_that_is_deleted_while_it_is_built(sessions):
    board = make_board(sessions[0])
    entries.advance(board.pk, 4, NOW)
    Leaderboard.everywhere.all().delete()
    assert not entries.advance(board.pk, 4, NOW)
    assert entries.find_unbuilt() is None


def test_the_form_says_how_far_it_is(sessions):
    board = make_board(sessions[0])
    entries.advance(board.pk, 3, NOW)
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
    builder = Builder()
    builder.wake()
    builder.wake()
    thread = builder._thread
    assert thread is not None
    thread.join(20)
    assert not thread.is_alive()
    assert builder._thread is None
    assert not Leaderboard.everywhere.filter(built_to__isnull=False).exists()
    assert BoardEntry.everywhere.count() == 2 * PEOPLE
    boards[0].save()
    builder.stop()
    builder.wake()  # the server is stopping: the next one goes on
    assert not [one for one in threading.enumerate() if one.name == "garry-boards"]
    assert Leaderboard.everywhere.filter(built_to=0).count() == 1


@pytest.mark.django_db(transaction=True)
def test_trouble_ends_the_thread_and_the_next_look_begins_again(sessions, monkeypatch, caplog):
    make_board(sessions[0])
    builder = Builder()
    with monkeypatch.context() as patch:
        patch.setattr(entries, "advance", lambda *_: 1 / 0)
        builder.wake()
        while (thread := builder._thread) is not None:
            thread.join(20)
    assert "A board could not be built" in caplog.text
    builder.wake()
    while (thread := builder._thread) is not None:
        thread.join(20)
    assert entries.find_unbuilt() is None
