"""What time does to boards: periods, the clinic's calendar, and a board that is frozen."""

from __future__ import annotations

from datetime import UTC, datetime, time, timedelta

import pytest
from django.utils import timezone

from rehab.boards.models import Leaderboard
from rehab.boards.panels.shared_panels import make_session_panels
from rehab.boards.snapshots import BoardSnapshot
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.corrections import CorrectedField, correct_session
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from tests.support.boards import (
    all_rows,
    board_of,
    figures_of,
    patient_of,
    people_of,
    rows_computed_anew,
    see,
    walk_down,
)
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = pytest.mark.django_db
SATURDAY = datetime(2026, 11, 21, 10, tzinfo=UTC)


def test_what_leaves_the_period_leaves_the_board_by_itself(clinic):
    now = timezone.now()
    board_of(clinic, period="days_30", display="top")
    people = people_of(clinic, 6)
    old = walk(people[0], "positive", strides(20, 0), days_ago=20, now=now)
    new = walk_down(people[1:], now=now)
    walk(people[0], "positive", strides(1, 9), days_ago=5, now=now)
    assert see(new[0], now).rows[0].title == people[0].alias
    assert see(new[0], now + timedelta(days=9)).rows[0].title == people[0].alias
    later = see(new[0], now + timedelta(days=10))
    assert people[0].alias not in [row.title for row in later.rows]
    assert later.rows[0].you
    assert not see(old, now + timedelta(days=31)).shared


@pytest.mark.parametrize(
    ("period", "days_ago", "counts"),
    [("week", 6, True), ("week", 7, False), ("month", 21, True), ("month", 22, False)],
)
def test_weeks_and_months_begin_by_the_clinics_calendar(period, days_ago, counts):
    """14 h east of Saturday, 10:00 UTC, Sunday has just begun."""
    clinic = Clinic.everywhere.create(name="Kiritimati", time_zone="Pacific/Kiritimati")
    board = board_of(clinic, period=period)
    walk(patient_of(clinic, "A"), "positive", strides(3, 0), days_ago=days_ago, now=SATURDAY)
    assert bool(figures_of(board, SATURDAY)) == counts


def test_dates_and_a_frozen_board_stay_as_they_were(clinic):
    day = NOW.date()
    dated = board_of(
        clinic,
        period="dates",
        period_from=day - timedelta(days=9),
        period_to=day - timedelta(days=5),
    )
    person = patient_of(clinic, "A")
    for days_ago, hits in ((10, 2), (9, 3), (5, 5), (4, 9)):
        walk(person, "positive", strides(hits, 10 - hits), days_ago=days_ago)
    frozen = board_of(clinic, name="Frozen", frozen_on=day - timedelta(days=5))
    for board in (dated, frozen):
        assert figures_of(board) == {person.pk: 50}


@pytest.mark.parametrize("period", ["dates", "all"])
def test_another_time_zone_is_another_day_at_once(period):
    clinic = Clinic.everywhere.create(name="Elm", boards_across=True, time_zone="UTC")
    day = SATURDAY.date()
    began = {"period_from": day, "period_to": day} if period == "dates" else {}
    how = {"metric": "active_minutes", "aggregation": "sum", "types": "all"}
    board = board_of(clinic, period=period, **began, **how)
    person = patient_of(clinic, "A")
    for hours in (8, 8, 1):  # the first two are Friday's in California
        walk(person, "positive", strides(2400, 0), now=SATURDAY - timedelta(hours=hours))
    assert figures_of(board, SATURDAY) == {person.pk: 60}
    clinic.time_zone = "America/Los_Angeles"
    clinic.save()
    assert figures_of(board, SATURDAY) == {person.pk: 40 if period == "dates" else 100}


# --- a frozen board -------------------------------------------------------------------------------


@pytest.fixture
def snapshot(clinic) -> tuple[Leaderboard, list[Patient], list[TrainingSession]]:
    """A board of six that was frozen five days ago, with two sessions of each."""
    people = people_of(clinic, 6)
    walk_down(people, days_ago=12)
    sessions = walk_down(people[::-1], "binary", days_ago=10)[::-1]
    frozen = NOW.date() - timedelta(days=5)
    board = board_of(clinic, types="all", frozen_on=frozen, display="top", names="code")
    assert len(figures_of(board)) == 6
    return board, people, sessions


def test_nobody_enters_a_frozen_board_and_no_later_session_alters_it(clinic, snapshot):
    board, people, sessions = snapshot
    before = all_rows()
    late = patient_of(clinic, "LATE", boards="own")
    walk(late, "positive", strides(30, 0), days_ago=9)
    late.boards = "clinic"
    late.save()
    walk(people[5], "positive", strides(30, 0))
    brought = walk(people[5], "positive", strides(30, 0), days_ago=11)  # from a sensor's log
    SessionMetric.everywhere.filter(session=brought, slug="hit_rate").delete()
    SessionMetric.everywhere.create(session=brought, slug="hit_rate", value=1.0)
    board.name = "Report"
    board.save()
    clinic.time_zone = "America/Los_Angeles"
    clinic.save()
    assert rows_computed_anew() == before
    assert "LATE" not in [row.title for row in see(sessions[0]).rows]


def test_who_leaves_a_frozen_board_has_left_it(clinic, snapshot):
    board, people, _sessions = snapshot
    rest = {one.pk for one in people}
    for person, name, value in ((people[0], "boards", "own"), (people[1], "blinded", True)):
        setattr(person, name, value)
        person.save()
        rest.remove(person.pk)
        assert figures_of(board).keys() == rest
        assert not any(person.pk in row for row in BoardSnapshot.everywhere.get().results)
    people[0].boards = "clinic"
    people[0].save()
    walk(people[0], "positive", strides(9, 1))
    assert figures_of(board).keys() == rest


def test_who_is_taken_out_of_the_group_leaves_its_frozen_board_and_nobody_joins(clinic, snapshot):
    board, people, _sessions = snapshot
    board.among = "group"
    board.save()
    board.group.set(people[:5])
    Leaderboard.everywhere.filter(pk=board.pk).update(name="Group")
    board.metric = "steps"  # another snapshot, of the group
    board.save()
    board.group.set(people[1:])
    assert figures_of(board).keys() == {one.pk for one in people[1:5]}


def test_nobody_agrees_into_a_board_that_nobody_has_looked_at_since_it_was_over(clinic):
    late = patient_of(clinic, "LATE", boards="own")
    walk_down([*people_of(clinic, 6), late], days_ago=9)
    board = board_of(clinic, types="all", frozen_on=NOW.date())
    Leaderboard.everywhere.update(frozen_on=NOW.date() - timedelta(days=2))
    over_midnight = patient_of(clinic, "NIGHT")
    walk(over_midnight, "positive", strides(9, 1), days_ago=1)
    began = datetime.combine(NOW.date() - timedelta(days=2), time(23, 59), UTC)
    TrainingSession.everywhere.filter(patient=over_midnight).update(started_at=began)
    late.boards = "clinic"
    late.save()
    assert len(figures_of(board)) == 6
    assert BoardSnapshot.everywhere.count() == 1


def test_a_correction_reaches_a_frozen_board(clinic, snapshot):
    board, people, _sessions = snapshot
    first, second = TrainingSession.everywhere.filter(patient=people[0]).order_by("started_at")
    lead = User.everywhere.create_user("lead", role=Role.LEAD, clinic=clinic)

    def correct(session: TrainingSession, counts: str) -> dict[int, int]:
        correct_session(session, {CorrectedField.COUNTS: counts}, "Wrong file.", lead, NOW)
        return figures_of(board)

    assert figures_of(board)[people[0].pk] == 100
    assert correct(first, "no")[people[0].pk] == 75
    assert people[0].pk not in correct(second, "no")
    assert len(correct(first, "yes")) == 5


def test_another_measure_of_a_frozen_board_is_another_snapshot(clinic, snapshot):
    board, _people, _sessions = snapshot
    patient = patient_of(clinic, "LATE")
    walk(patient, "positive", strides(9, 0), days_ago=9)
    board.metric = "steps"
    board.save()
    assert figures_of(board)[patient.pk] == 9
    assert len(figures_of(board)) == 7


def test_what_left_the_period_before_the_freeze_is_not_in_it(clinic):
    people = people_of(clinic, 6)
    day = NOW.date() + timedelta(days=12)
    board = board_of(clinic, types="all", display="top", frozen_on=day, period="days_30")
    old = walk_down(people[:3], days_ago=20)
    walk_down(people[3:], days_ago=3)
    assert len(figures_of(board)) == 6
    after = NOW + timedelta(days=40)  # nobody has looked meanwhile
    assert not make_session_panels(old[0], after)[0].shared
    assert figures_of(board, after).keys() == {one.pk for one in people[3:]}
