"""Who is expected when: planned in one tap, listed with how far today has come."""

from __future__ import annotations

from datetime import UTC, datetime, time, timedelta

import pytest
from django.utils import timezone

from rehab.patients.caseload import load_caseload
from rehab.patients.visits import Progress, Visit, patients_today, plan_visit, suggested_time
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day import dashboard
from tests.support.clock import HERE
from tests.support.walks import HIT, walk
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db


@pytest.fixture
def world(world: World) -> World:
    Visit.everywhere.all().delete()
    then = NOW - timedelta(9)
    sessions = TrainingSession.everywhere.filter(pk=world.session.pk)
    sessions.update(created_at=then, started_at=then)
    return world


def test_today_lists_who_walks_who_is_expected_and_who_is_done(world):
    names = ("Ana", "Bo", "Cleo", "Dora", "Emil", "Fay")
    ana, bo, cleo, dora, emil, fay = (world.add_patient(name) for name in names)
    today = HERE.date()
    plan_visit(ana, today, time(9, 30))
    plan_visit(bo, today, None)
    plan_visit(cleo, today, time(9, 0))
    plan_visit(fay, today + timedelta(1), time(8, 0))
    walk(cleo, "positive", [HIT] * 130)
    walk(dora, "positive", [HIT] * 3, end=None)  # came without a plan, and walks
    walk(emil, "positive", [HIT], days_ago=1)
    walk(emil, "positive", [HIT], simulated=True)  # nobody was here
    listed = patients_today(world.people[Role.PT], HERE)
    assert [(row.patient.nickname, row.at, row.progress) for row in listed] == [
        ("Cleo", time(9, 0), Progress.DONE),
        ("Ana", time(9, 30), Progress.EXPECTED),
        ("Dora", HERE.time().replace(second=0), Progress.WALKING),
        ("Bo", None, Progress.EXPECTED),
    ]
    assert [row.is_late for row in listed] == [False, True, False, False]
    assert listed[0].walked_s == pytest.approx(130, abs=3)


def test_who_is_late_for_hours_did_not_come(world):
    for name, at in (("Ana", time(9, 0)), ("Bo", time(11, 55)), ("Cleo", time(8, 55))):
        plan_visit(world.add_patient(name), HERE.date(), at)
    noon = HERE.replace(hour=12, minute=0, second=0)
    listed = patients_today(world.people[Role.PT], noon)
    found = [(row.patient.nickname, row.is_late, row.is_missed) for row in listed]
    assert found == [("Cleo", True, True), ("Ana", True, False), ("Bo", False, False)]


def test_who_was_here_today_is_next_expected_another_day(world, pt):
    cleo = world.add_patient("Cleo")
    plan_visit(cleo, HERE.date(), time(9, 0))
    page = f"/patients/{cleo.pk}/"
    assert "Start training" in (before := pt.get(page).content.decode())
    assert "Remove the visit of" in before
    walk(cleo, "positive", [HIT] * 130)
    later = plan_visit(cleo, HERE.date() + timedelta(7), time(9, 0))
    assert "Train again today" in (after := pt.get(page).content.decode())
    assert after.count("Remove the visit of") == 1
    assert after.count('aria-pressed="true" disabled') == 1  # the day that is planned is no choice
    assert "here today" in after
    assert after.index("Train again today") < after.index("Next visit")
    assert after.index("Next visit") < after.index("Last session: today")
    planning = 'class="visits card" open'
    assert planning not in after
    later.delete()
    assert planning in " ".join(pt.get(page).content.decode().split())
    later.save()
    (case,) = [one for one in load_caseload(world.people[Role.PT], HERE) if one.patient == cleo]
    assert case.next_visit == later


def test_a_day_is_the_clinics_own(world):
    rosa = world.add_patient()
    plan_visit(rosa, NOW.date(), None)
    late = NOW.replace(hour=23, minute=30)
    assert patients_today(world.people[Role.PT], late)
    world.clinic.time_zone = "Asia/Tokyo"
    world.clinic.save()
    Visit.everywhere.all().delete()
    world.pt.post(f"/patients/{rosa.pk}/visits/", {"in": "0"})
    (visit,) = Visit.everywhere.all()
    assert visit.day == (timezone.now() + timedelta(hours=9)).date()


def test_who_was_set_up_yesterday_and_walked_today_is_on_both_lists_of_today(world):
    rosa, pt = world.add_patient(), world.people[Role.PT]
    session = walk(rosa, "positive", [HIT] * 9)
    sessions = TrainingSession.everywhere.filter(pk=session.pk)
    sessions.update(created_at=NOW - timedelta(1))
    assert [row.progress for row in patients_today(pt, HERE)] == [Progress.DONE]
    assert [row.session for row in dashboard.sessions_today(pt, world.clinic, HERE)] == [session]
    sessions.update(started_at=NOW - timedelta(1))
    assert patients_today(pt, HERE) == []
    assert dashboard.sessions_today(pt, world.clinic, HERE) == []


def test_the_first_of_two_midnights_begins_the_day(world):
    """In Havana the hour after midnight comes twice on November 1, 2026: at 4 and at 5 UTC."""
    world.clinic.time_zone = "America/Havana"
    world.clinic.save()
    pt, first = world.people[Role.PT], datetime(2026, 11, 1, 4, 30, tzinfo=UTC)
    walked = walk(world.add_patient(), "positive", [HIT] * 9, now=first)
    now = clinic_time(first + timedelta(hours=1), world.clinic)  # it is half past twelve again
    assert [row.patient for row in patients_today(pt, now)] == [walked.patient]
    listed = dashboard.sessions_today(pt, world.clinic, now)
    assert walked in [line.session for line in listed]


def test_the_next_visit_is_one_tap_at_the_usual_time(world):
    rosa = world.add_patient()
    session = walk(rosa, "positive", [HIT])
    began = datetime(2026, 10, 20, 10, 8, tzinfo=HERE.tzinfo)
    TrainingSession.everywhere.filter(pk=session.pk).update(created_at=began)
    assert suggested_time(world.people[Role.PT], rosa, HERE) == time(10, 15)
    client, today = world.pt, timezone.now().astimezone(HERE.tzinfo).date()
    page = client.get(f"/patients/{rosa.pk}/").content.decode()
    assert "In a week" in page
    assert "10:15" in page
    for days in ("1", "2", "7", "7"):  # tapped twice it is planned once
        answer = client.post(f"/patients/{rosa.pk}/visits/", {"in": days}, follow=True)
    assert "is expected on" in answer.content.decode()
    planned = list(Visit.everywhere.values_list("day", "at"))
    assert planned == [(today + timedelta(days), time(10, 15)) for days in (1, 2, 7)]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"day": "", "at": ""}, "Choose the day"),
        ({"day": "2026-02-31"}, "Choose the day"),
        ({"day": "soon"}, "Choose the day"),
        ({"day": "2020-01-01"}, "between today and a year"),
        ({"day": "2199-01-01"}, "between today and a year"),
        ({"in": "9999999999"}, "Choose the day"),
        ({"day": f"{HERE:%Y-%m-%d}", "at": "25:99"}, "a time such as 10:30"),
    ],
)
def test_a_day_that_cannot_be_says_what_to_do(world, given, said):
    url = f"/patients/{world.patient.pk}/visits/"
    answer = world.pt.post(url, given, follow=True)
    assert said in answer.content.decode()
    assert not Visit.everywhere.exists()


def test_a_visit_is_removed_from_its_own_patient_alone(world):
    rosa, joon = world.add_patient(), world.add_patient("Joon")
    mine = plan_visit(rosa, timezone.now().date() + timedelta(1), time(9, 30))
    other = plan_visit(joon, timezone.now().date() + timedelta(1), None)
    client = world.pt
    client.post(f"/patients/{rosa.pk}/visits/", {"remove": other.pk})
    assert Visit.everywhere.filter(pk=other.pk).exists()
    client.post(f"/patients/{rosa.pk}/visits/", {"remove": mine.pk})
    assert not Visit.everywhere.filter(pk=mine.pk).exists()
