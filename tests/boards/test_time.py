"""What time does to boards: periods, the clinic's calendar, and a board that is frozen."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from django.core.management import call_command
from django.utils import timezone

from rehab.boards.building import entries
from rehab.boards.models import Leaderboard
from rehab.boards.panels.viewer import make_session_panels
from rehab.boards.rows import BoardCount, BoardEntry
from rehab.people.models import Clinic, Patient
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from tests.support.boards import board_of, everything, patient_of, people_of, see, walk_down
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = pytest.mark.django_db
SATURDAY = datetime(2026, 11, 21, 10, tzinfo=UTC)


def test_what_leaves_the_period_leaves_the_board_by_itself(clinic):
    now = timezone.now()  # rows are kept up by the clock
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
    entries.refresh(board, now=SATURDAY)
    assert BoardEntry.everywhere.exists() == counts


def test_dates_and_a_frozen_board_stay_as_they_were(clinic):
    day = NOW.date()
    dated = board_of(
        clinic,
        period="dates",
        period_from=day - timedelta(days=9),
        period_to=day - timedelta(days=5),
    )
    frozen = board_of(clinic, name="Frozen", frozen_on=day - timedelta(days=5))
    person = patient_of(clinic, "A")
    for days_ago, hits in ((10, 2), (9, 3), (5, 5), (4, 9)):
        walk(person, "positive", strides(hits, 10 - hits), days_ago=days_ago)
    for board in (dated, frozen):
        entries.refresh(board, now=NOW)
        assert BoardEntry.everywhere.get(board=board).figure == 50


@pytest.mark.parametrize("period", ["dates", "all"])
def test_another_time_zone_is_another_day_at_once(period):
    clinic = Clinic.everywhere.create(name="Elm", boards_across=True, time_zone="UTC")
    day = SATURDAY.date()
    began = {"period_from": day, "period_to": day} if period == "dates" else {}
    how = {"metric": "active_minutes", "aggregation": "sum", "types": "all"}
    board_of(clinic, period=period, **began, **how)
    person = patient_of(clinic, "A")
    for hours in (8, 8, 1):  # the first two are Friday's in California
        walk(person, "positive", strides(2400, 0), now=SATURDAY - timedelta(hours=hours))
    before = everything()
    assert BoardEntry.everywhere.get().figure == 60
    clinic.time_zone = "America/Los_Angeles"
    clinic.save()
    kept = everything()
    assert kept != before
    call_command("rebuildboards", verbosity=0)
    assert everything() == kept


# --- a frozen board -------------------------------------------------------------------------------


@pytest.fixture
def snapshot(clinic) -> tuple[Leaderboard, list[Patient], list[TrainingSession]]:
    """A board of six that was frozen five days ago, with two sessions of each."""
    people = people_of(clinic, 6)
    walk_down(people, days_ago=12)
    sessions = walk_down(people[::-1], "binary", days_ago=10)[::-1]
    frozen = NOW.date() - timedelta(days=5)
    board = board_of(clinic, types="all", frozen_on=frozen, display="top", names="code")
    assert BoardEntry.everywhere.count() == 6
    return board, people, sessions


def test_nobody_enters_a_frozen_board_and_no_later_session_alters_it(clinic, snapshot):
    board, people, sessions = snapshot
    before = everything()
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
    call_command("rebuildboards", verbosity=0)
    assert everything() == before
    assert "LATE" not in [row.title for row in see(sessions[0]).rows]


def test_who_leaves_a_frozen_board_has_left_it(clinic, snapshot):
    _board, people, _sessions = snapshot
    rest = {one.pk for one in people}
    for person, name, value in ((people[0], "boards", "own"), (people[1], "blinded", True)):
        setattr(person, name, value)
        person.save()
        rest.remove(person.pk)
        assert set(BoardEntry.everywhere.values_list("patient", flat=True)) == rest
    people[0].boards = "clinic"
    people[0].save()
    walk(people[0], "positive", strides(9, 1))
    assert set(BoardEntry.everywhere.values_list("patient", flat=True)) == rest
    assert sum(BoardCount.everywhere.values_list("rows", flat=True)) == len(rest)
    Patient.everywhere.filter(pk=people[2].pk).update(boards="own")  # behind our back
    call_command("rebuildboards", verbosity=0)
    assert set(BoardEntry.everywhere.values_list("patient", flat=True)) == rest - {people[2].pk}
    assert sum(BoardCount.everywhere.values_list("rows", flat=True)) == len(rest) - 1


def test_a_correction_reaches_a_frozen_board(clinic, snapshot):
    _board, people, _sessions = snapshot
    assert BoardEntry.everywhere.get(patient=people[0]).figure == 100
    mine = TrainingSession.everywhere.filter(patient=people[0]).order_by("started_at")
    first, second = mine
    first.excluded = True
    first.save()
    assert BoardEntry.everywhere.get(patient=people[0]).figure == 75
    second.excluded = True
    second.save()
    assert not BoardEntry.everywhere.filter(patient=people[0]).exists()
    assert BoardEntry.everywhere.count() == 5
    first.excluded = False
    first.save()
    assert BoardEntry.everywhere.count() == 5


def test_another_measure_of_a_frozen_board_is_another_snapshot(clinic, snapshot):
    board, _people, _sessions = snapshot
    patient = patient_of(clinic, "LATE")
    walk(patient, "positive", strides(9, 0), days_ago=9)
    board.metric = "steps"
    board.save()
    assert BoardEntry.everywhere.get(patient=patient).figure == 9
    assert BoardEntry.everywhere.count() == 7


def test_what_left_the_period_before_the_freeze_is_not_in_it(clinic):
    now = timezone.now()  # signals keep the rows up by the clock
    day = now.date()
    people = people_of(clinic, 6)
    board = board_of(clinic, types="all", display="top", frozen_on=day, names="code")
    old = walk_down(people[:3], days_ago=20, now=now)
    walk_down(people[3:], days_ago=3, now=now)
    board.period = "days_30"
    board.save()
    assert BoardEntry.everywhere.count() == 6
    Leaderboard.everywhere.update(frozen_on=day + timedelta(days=12))
    after = now + timedelta(days=40)  # nobody looked meanwhile
    assert not make_session_panels(old[0], after)[0].shared
    assert set(BoardEntry.everywhere.values_list("patient", flat=True)) == {
        one.pk for one in people[3:]
    }
