"""Who takes part in boards, until a patient takes it back; and of which clinics."""

from __future__ import annotations

import pytest
from django.urls import reverse

from rehab.boards.panels.shared_panels import make_session_panels
from rehab.people.models import Clinic, Patient
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station
from tests.support.boards import (
    board_of,
    figures_of,
    page_of,
    patient_of,
    people_of,
    see,
    tablet_at,
    walk_down,
)
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = pytest.mark.django_db


def test_who_has_not_agreed_stands_on_none_and_sees_none(clinic):
    board = board_of(clinic)
    sessions = walk_down(people_of(clinic, 6))
    alone = patient_of(clinic, "S", "own")
    shown = see(walk(alone, "positive", strides(20, 0)))
    assert (shown.shared, shown.note) == (False, "These are your own sessions.")
    assert alone.pk not in figures_of(board)
    assert see(sessions[0]).rows[0].rank == 1
    totals_only = patient_of(clinic, "T", "total")
    assert not see(walk(totals_only, "positive", strides(20, 0))).shared


def test_taken_back_on_the_tablet_it_is_gone_with_the_next_view_of_two_tablets(clinic):
    board_of(clinic, display="top", top_n=3)
    people = people_of(clinic, 7)
    sessions = walk_down(people)
    stations = [Station.everywhere.create(clinic=clinic, name=name) for name in ("East", "West")]
    for session, station in zip(sessions, stations, strict=False):
        TrainingSession.everywhere.filter(pk=session.pk).update(station=station)
    tablets = [tablet_at(station) for station in stations]
    east, west = (page_of(s, t) for s, t in zip(sessions, tablets, strict=False))
    first, second = people[0].alias, people[1].alias
    assert f"<b>You</b> {first}" in " ".join(east.split())
    assert f"<b>You</b> {second}" in " ".join(west.split())
    assert first in west
    assert second in east
    leave = reverse("leave-boards", kwargs={"session_id": sessions[0].pk})
    assert tablets[1].post(leave).status_code == 404
    assert tablets[0].post(leave).status_code == 302
    assert first not in page_of(sessions[1], tablets[1])
    own = page_of(sessions[0], tablets[0])
    assert "These are your own sessions." in own
    assert second not in own
    assert see(sessions[1]).rows[0].you


def test_taken_back_behind_our_back_the_row_is_not_shown_either(clinic):
    board_of(clinic, display="top", top_n=3)
    people = people_of(clinic, 8)
    sessions = walk_down(people)
    Patient.everywhere.filter(pk=people[0].pk).update(boards="own")
    assert people[0].alias not in [row.title for row in see(sessions[1]).rows]


def test_in_a_blinded_study_there_is_no_board_and_no_score(clinic):
    board = board_of(clinic)
    people = people_of(clinic, 6)
    sessions = walk_down(people)
    people[0].blinded = True
    people[0].save()
    sessions[0].refresh_from_db()
    assert make_session_panels(sessions[0], NOW) == []
    page = page_of(sessions[0])
    assert "This walk is over. Your study shows no scores." in " ".join(page.split())
    assert 'class="value"' not in page
    assert people[0].pk not in figures_of(board)


def test_initials_and_codes_are_unique_on_what_is_shown(clinic):
    board = board_of(clinic, names="initials", display="top", top_n=3)
    people = people_of(clinic, 5)
    sessions = walk_down(people)
    assert [row.title for row in see(sessions[0]).rows] == ["N.C.", "N.C. 2", "N.C. 3"]
    board.names = "code"
    board.save()
    assert [row.title for row in see(sessions[0]).rows] == ["C-0", "C-1", "C-2"]


def test_a_new_animal_name_is_seen_at_once(clinic):
    board_of(clinic, display="top", top_n=1)
    people = people_of(clinic, 5)
    sessions = walk_down(people)
    old = people[0].alias
    people[0].draw_alias()
    people[0].save(update_fields=["alias"])
    assert people[0].alias != old
    assert see(sessions[1]).rows[0].title == people[0].alias


# --- clinics --------------------------------------------------------------------------------------


def test_clinic_a_never_sees_b(clinic):
    other = Clinic.everywhere.create(name="Oak")
    board_of(clinic, display="top")
    board_of(other, display="top")
    mine, theirs = walk_down(people_of(clinic, 5)), walk_down(people_of(other, 9))
    assert len(see(mine[0]).rows) == 3
    assert len(see(theirs[0]).rows) == 5
    assert not {row.title for row in see(mine[0]).rows} & {row.title for row in see(theirs[0]).rows}


def test_across_clinics_stand_those_who_agreed_of_clinics_that_take_part(clinic):
    oak = Clinic.everywhere.create(name="Oak", boards_across=True)
    elsewhere = Clinic.everywhere.create(name="Yew")
    board = board_of(None, among="across", display="top")
    for place in (clinic, oak, elsewhere):
        walk_down(people_of(place, 3, boards="across"))
    walk(patient_of(clinic, "X", "clinic"), "positive", strides(30, 0))
    assert len(figures_of(board)) == 6
    session = TrainingSession.everywhere.filter(clinic=oak).first()
    assert see(session).shared
    assert (
        make_session_panels(TrainingSession.everywhere.filter(clinic=elsewhere).first(), NOW) == []
    )
    oak.boards_across = False
    oak.save()
    assert len(figures_of(board)) == 3


def test_a_group_compares_the_chosen_alone(clinic):
    people = people_of(clinic, 9)
    sessions = walk_down(people)
    board = board_of(clinic, among="group", display="top")
    assert not see(sessions[0]).shared
    board.group.set(people[2:8])
    assert [row.title for row in see(sessions[2]).rows] == [one.alias for one in people[2:5]]
    assert not see(sessions[0]).shared
