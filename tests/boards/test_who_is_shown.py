"""Boards of several patients: who stands on them, who sees what, and what nobody is shown."""

from __future__ import annotations

import re

import pytest
from django.test import Client
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.boards.panels.shared_panels import BoardViewer, make_waiting_panels
from rehab.people.models import Patient
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station
from rehab.training.changes import Change, ChangeKind
from rehab.training.phases import make_phase
from tests.support.boards import (
    all_rows,
    board_of,
    figures_of,
    page_of,
    patient_of,
    people_of,
    see,
    tablet_at,
    told,
    walk_down,
)
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = pytest.mark.django_db


def walk_two_types(patient: Patient, **how) -> TrainingSession:
    """Begin with positive feedback and go on with negative; hit every step."""
    change = [Change(ChangeKind.VALENCE, "negative"), Change(ChangeKind.PHASE, 1)]
    phases = (make_phase("training"), make_phase("training", "Later"))
    walked = [*strides(10, 0), *change, *strides(10, 0)]
    return walk(patient, "positive", walked, phases=phases, **how)


@pytest.mark.parametrize(
    ("fields", "stands"),
    [
        ({"types": "all", "metric": "hit_rate"}, True),
        ({"types": "same", "metric": "hit_rate"}, False),
        ({"types": "chosen", "valences": ["positive"], "metric": "hit_rate"}, False),
        ({"types": "same", "metric": "score"}, False),
        ({"types": "same", "metric": "hit_rate", "tie_breaker": "score"}, False),
    ],
)
def test_a_session_of_two_types_stands_on_no_board_of_points_or_of_one_type(clinic, fields, stands):
    board = board_of(clinic, **fields)
    people = people_of(clinic, 6)
    walk_down(people[1:])
    session = walk_two_types(people[0])
    assert (session.valence, session.changed_to) == ("positive", "negative")
    assert (people[0].pk in figures_of(board)) == stands


def test_a_type_that_nobody_walked_with_keeps_no_session_away(clinic):
    board = board_of(clinic, types="same", metric="score")
    people = people_of(clinic, 6)
    walk_down(people[1:])
    by_mistake = [Change(ChangeKind.VALENCE_NOW, slug) for slug in ("negative", "positive")]
    session = walk(people[0], "positive", [*strides(5, 0), *by_mistake, *strides(5, 0)])
    assert session.changed_to == ""
    assert people[0].pk in figures_of(board)


@pytest.mark.parametrize("language", ["en", "es"])
def test_a_session_of_two_types_is_compared_by_its_hits_alone(clinic, language):
    person = patient_of(clinic, "A", language=language)
    station = Station.everywhere.create(clinic=clinic, name="S")
    tablet = tablet_at(station)
    plain, mixed = walk(person, "positive", strides(9, 1)), walk_two_types(person)

    def boards_after(session: TrainingSession) -> list[tuple[str, int]]:
        TrainingSession.everywhere.update(station=None)  # a tablet sees the one just ended alone
        TrainingSession.everywhere.filter(pk=session.pk).update(station=station)
        boards = tablet.get(reverse("scores", args=[session.pk])).context["boards"]
        return [(board.slug, len(board.rows)) for board in boards]

    assert boards_after(mixed) == [("all", 2)]
    assert boards_after(plain) == [("same", 1)]


# --- who stands on a board ----------------------------------------------------------------------


def test_neighbors_with_pseudonyms_after_a_session(clinic):
    board_of(clinic)
    people = people_of(clinic, 11)
    sessions = walk_down(people)
    shown = see(sessions[3])
    assert told(shown) == [
        (2, "95%", False),
        (3, "90%", False),
        (4, "85%", True),
        (5, "80%", False),
        (6, "75%", False),
    ]
    assert shown.rows[0].follows_gap
    names = [row.title for row in shown.rows]
    assert names == [person.alias for person in people[1:6]]
    assert len(set(names)) == 5
    assert not any(
        person.nickname in name or person.code in name for person in people for name in names
    )


def test_no_sessions_and_the_first_ever(clinic):
    board = board_of(clinic)
    person = patient_of(clinic, "A")
    assert BoardViewer(board, NOW, person).make_panel().rows == []
    session = walk(person, "positive", strides(3, 1))
    shown = see(session)
    assert not shown.shared
    assert shown.note == "Fewer than 5 people so far. These are your own sessions."
    assert told(shown) == [(1, "75%", True)]


@pytest.mark.wide
def test_the_newest_session_is_the_worst_of_a_hundred_own_ones(clinic):
    Leaderboard.everywhere.create(clinic=clinic, name="Own", period="all", min_valid_strides=1)
    person = patient_of(clinic, "A", "own")
    for number in range(99):
        walk(person, "positive", strides(2, 1), days_ago=number + 1)
    shown = see(walk(person, "positive", strides(1, 9)))
    assert told(shown) == [(1, "67%", False), (1, "67%", False), (100, "10%", True)]
    assert shown.rows[0].follows_gap


def test_four_participants_see_their_own_sessions_and_why_five_see_the_board(clinic):
    board_of(clinic)
    people = people_of(clinic, 5)
    sessions = walk_down(people[:4])
    before = see(sessions[0])
    assert not before.shared
    assert "Fewer than 5 people" in before.note
    walk(people[4], "positive", strides(1, 9))
    after = see(sessions[0])
    assert after.shared
    assert len(after.rows) == 3


def test_simulated_patients_hide_no_person(clinic):
    board = board_of(clinic, types="all", include_simulated=True, display="top", names="code")
    simulated = [patient_of(clinic, f"S{number}", simulated=True) for number in range(5)]
    sessions = [walk(one, "positive", strides(8, 2), simulated=True) for one in simulated]
    tried = see(sessions[0])  # alone they are shown: whoever tries GARRY sees a board
    assert tried.shared
    assert tried.summary == "5 patients on it now."
    people = people_of(clinic, 5)
    walk(people[0], "positive", strides(9, 1))
    for viewer in (BoardViewer(board, NOW, simulated[0]), BoardViewer(board, NOW, people[0])):
        shown = viewer.make_panel()
        assert not shown.shared
        assert "C-0" not in [row.title for row in shown.rows]
        assert shown.summary.startswith("1 patient on it now. Under 5")
    walk_down(people[1:])
    shown = BoardViewer(board, NOW, people[0]).make_panel()
    assert shown.shared
    assert shown.summary == "10 patients on it now."


def test_nobody_is_shown_in_the_last_half_and_who_is_there_sees_the_own_sessions(clinic):
    board = board_of(clinic)
    sessions = walk_down(people_of(clinic, 9))
    assert [row.rank for row in see(sessions[4]).rows] == [3, 4, 5]
    worst = see(sessions[8])
    assert not worst.shared
    assert told(worst) == [(1, "60%", True)]
    board.display = "top_and_me"
    board.save()
    last = see(sessions[8])
    assert told(last)[-1] == (None, "60%", True)
    assert last.rows[-1].follows_gap
    assert [row.rank for row in last.rows[:-1]] == [1, 2, 3, 4, 5]


def test_ties_at_the_cut_are_all_shown(clinic):
    board = board_of(clinic, display="top", top_n=2)
    people = people_of(clinic, 8)
    sessions = [
        walk(one, "positive", strides(hits, 10 - hits), days_ago=9 - day)
        for day, (one, hits) in enumerate(zip(people, (9, 7, 7, 7, 5, 4, 3, 2), strict=True))
    ]
    assert [row[:2] for row in told(see(sessions[0]))] == [
        (1, "90%"),
        (2, "70%"),
        (2, "70%"),
        (2, "70%"),
    ]
    assert [row.title for row in see(sessions[0]).rows] == [one.alias for one in people[:4]]
    for ties, ranks in (("dense", [1, 2, 2, 2]), ("earlier", [1, 2])):
        board.ties = ties
        board.save()
        assert [row.rank for row in see(sessions[0]).rows] == ranks


def test_a_tie_breaker_comes_before_the_earlier_date(clinic):
    board_of(clinic, display="top", top_n=3, ties="earlier", tie_breaker="steps")
    people = people_of(clinic, 6)
    counts = (10, 20, 30, 10, 10, 10)
    sessions = [
        walk(one, "positive", strides(count, 0), days_ago=9 - day)
        for day, (one, count) in enumerate(zip(people, counts, strict=True))
    ]
    assert [row.title for row in see(sessions[0]).rows] == [
        people[2].alias,
        people[1].alias,
        people[0].alias,
    ]


def test_kept_points_break_ties_and_reward_no_short_walk(clinic):
    board_of(
        clinic,
        types="chosen",
        valences=["negative"],
        tie_breaker="score",
        display="top",
        ties="earlier",
    )
    people = people_of(clinic, 6)
    sessions = [
        walk(one, "negative", strides(9 * tens, tens), days_ago=9 - tens)
        for one, tens in zip(people, (1, 2, 3, 4, 5, 6), strict=True)
    ]
    walked_most = [one.alias for one in people[:2:-1]]
    assert [row.title for row in see(sessions[5]).rows] == walked_most


@pytest.mark.parametrize(
    "gone", [{"steps"}, {"steps", "hit_rate", "active_minutes"}], ids=["no steps", "points alone"]
)
def test_lost_points_without_a_stake_are_told_to_nobody(clinic, gone):
    """Sessions that were imported have their points, and may have nothing else."""
    board = board_of(
        clinic, metric="score", types="chosen", valences=["negative"], min_valid_strides=0
    )
    people = people_of(clinic, 6)
    sessions = walk_down(people, "negative")
    imported = SessionMetric.everywhere.filter(session=sessions[0])
    imported.filter(slug__in=gone).delete()
    assert figures_of(board).keys() == {one.pk for one in people[1:]}
    assert "−" not in page_of(sessions[0]).split('id="board-')[1].split("</section>")[0]


def test_a_patient_with_mixed_types_has_a_row_on_each_list(clinic):
    board_of(clinic, metric="score")
    people = people_of(clinic, 5)
    positive = walk_down(people)
    binary = walk_down(people, "binary")
    negative = walk_down(people, "negative")
    assert told(see(positive[0]))[0] == (1, "20", True)
    assert told(see(binary[1]))[1] == (2, "18", True)
    kept = see(negative[1])
    assert kept.kept
    assert [(row.rank, row.value, row.points_at_stake) for row in kept.rows] == [
        (None, "20", "20"),
        (None, "19", "20"),
        (None, "18", "20"),
    ]
    assert [len(rows) for rows in all_rows().values()] == [5, 5, 5]
    explicit = walk(people[0], "explicit", strides(9, 1))
    assert see(explicit).rows == []


def test_negative_points_are_told_as_kept_never_as_a_loss(clinic):
    board_of(clinic, metric="score", types="chosen", valences=["negative"])
    people = people_of(clinic, 6)
    session = walk(people[0], "negative", strides(288, 12))
    walk_down(people[1:], "negative")
    page = page_of(session)
    assert "<small>kept</small> 288 <small>of 300</small>" in page
    assert "−" not in page
    assert 'class="rank"' not in page.split('id="board-')[1].split("</section>")[0]


# --- tablets --------------------------------------------------------------------------------------


def test_a_waiting_tablet_shows_the_clinics_board_once_there_are_enough(clinic):
    board_of(clinic, occasion="waiting", display="top", types="all")
    people = people_of(clinic, 6)
    walk_down(people[:4])
    tablet = tablet_at(Station.everywhere.create(clinic=clinic, name="East"))
    url = reverse("waiting-board")
    assert tablet.get(url).status_code == 204
    walk_down(people[4:])
    page = tablet.get(url).content.decode()
    assert re.findall(r"</b> |<span class=\"day\">(\w+ \w+)", page)[0] in {p.alias for p in people}
    assert "You" not in page
    assert make_waiting_panels(clinic, NOW)
    assert Client().get(url).status_code == 302
