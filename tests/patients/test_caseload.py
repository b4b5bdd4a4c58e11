"""The caseload: who is due, stuck, improving or new."""

from __future__ import annotations

from datetime import date, timedelta

import pytest

from rehab.patients.caseload import Case, Walk, judge, load_caseload
from rehab.patients.visits import Visit, plan_visit
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from tests.support.walks import HIT, make_session, walk
from tests.support.world import NOW, build_world, client_of

TODAY = date(2026, 11, 21)


def walks(*goals, days_ago=1, higher=True, measure=1):
    return [
        Walk(TODAY - timedelta(days=days_ago + place), goal, measure, "W/kg", higher)
        for place, goal in enumerate(goals)
    ]


@pytest.mark.parametrize(
    ("newest_first", "next_day", "missed", "flags"),
    [
        ([], TODAY, None, ["new"]),
        ([], None, None, ["due", "new"]),
        (walks(4.0, 4.0, 4.0), None, None, ["stuck"]),
        (walks(3.9, 3.9, 4.0), None, None, ["stuck"]),  # it went down a little
        (walks(3.8, 3.9, 4.0), None, None, ["declining"]),
        (walks(1.1, 1.0, 1.0, higher=False), None, None, ["declining"]),
        (walks(4.1, 4.0, 4.0), None, None, []),
        (walks(4.2, 4.1, 4.0), None, None, ["improving"]),
        (walks(4.0, 4.0), None, None, []),  # too few to say
        (walks(None, 4.0, 4.0), None, None, []),
        (walks(0.9, 1.0, 1.1, higher=False), None, None, ["improving"]),
        (walks(4.0, 4.0) + walks(4.0, measure=2), None, None, []),
        (walks(4.2, 4.1, 4.0, days_ago=7), None, None, ["due", "improving"]),
        (walks(4.2, 4.1, 4.0, days_ago=7), TODAY, None, ["improving"]),
        (walks(4.2, 4.1, 4.0, days_ago=3), TODAY, TODAY - timedelta(1), ["due", "improving"]),
    ],
)
def test_flags(newest_first, next_day, missed, flags):
    assert list(judge(newest_first, next_day, missed, TODAY)) == flags


@pytest.mark.parametrize(
    ("newest_first", "told"),
    [
        ([], ("", "")),
        ([2.5, 2.0, 2.0], ("2.00 → 2.50 W/kg", "harder goal than 3 sessions ago")),
        ([2.0, 2.0], ("2.00 W/kg", "")),
        ([1.5, 2.0], ("2.00 → 1.50 W/kg", "")),  # too few to say
        ([2.0, 2.0, 1.99], ("1.99 → 2.00 W/kg", "no harder goal in 3 sessions")),
        ([1.5, 1.8, 2.0], ("2.00 → 1.80 → 1.50 W/kg", "easier goal than 3 sessions ago")),
    ],
)
def test_how_the_goal_went(newest_first, told):
    newest = walks(*newest_first)
    case = Case(Patient(), newest, 0, None, None, judge(newest, TODAY, None, TODAY))
    reasons = [reason for _flag, _label, reason in case.tell(TODAY)]
    assert (case.goals, "".join(reasons)) == told


@pytest.mark.django_db
def test_the_page_lists_patients_of_this_clinic_alone(world):
    other = build_world("cobalt")
    TrainingSession.everywhere.filter(patient=world.patient).update(
        simulated=False, active_s=60, created_at=NOW - timedelta(9), started_at=None
    )
    Visit.everywhere.all().delete()
    now = clinic_time(NOW, world.clinic)
    plan_visit(world.patient, now.date() - timedelta(2), None)

    def missed():
        cases = load_caseload(world.people[Role.PT], now)
        return next(case.missed for case in cases if case.patient == world.patient)

    walk(world.patient, "positive", [HIT, HIT], simulated=True)  # nobody was here
    assert missed() == now.date() - timedelta(2)
    page = client_of(world).get("/caseload/?only=due").content.decode()
    assert world.patient.nickname in page
    assert "did not come on" in page
    assert other.patient.nickname not in page
    walk(world.patient, "positive", [HIT, HIT])
    TrainingSession.everywhere.filter(patient=world.patient).update(simulated=False, active_s=60)
    assert missed() is None
    assert client_of(world).get("/caseload/?only=nonsense").status_code == 200


@pytest.mark.django_db
def test_who_is_late_today_is_overdue_and_comes_by_time(world):
    Visit.everywhere.all().delete()
    now = clinic_time(NOW, world.clinic)
    for name, minutes in (("Bo", -185), ("Ana", -30), ("Cleo", -5), ("Dora", 30)):
        plan_visit(world.add_patient(name), now.date(), (now + timedelta(minutes=minutes)).time())
    user = world.people[Role.PT]
    cases = load_caseload(user, now)
    come = [(case.patient.nickname, "due" in case.flags) for case in cases if case.next_visit]
    assert come == [("Ana", True), ("Cleo", False), ("Dora", False)]
    to_plan = {case.patient.nickname for case in cases if case.needs_visit}
    assert {"Bo"} <= to_plan <= {"Bo", world.patient.nickname}  # who is late may yet come
    told = {case.patient.nickname: case.tell(now.date()) for case in cases}
    make_session(Patient.everywhere.get(nickname="Ana"))  # she came, and is about to start
    (ana,) = (one for one in load_caseload(user, now) if one.patient.nickname == "Ana")
    assert (ana.is_here, ana.missed, list(ana.flags)) == (True, None, ["new"])
    assert (told["Bo"][0][2], told["Ana"][0][2]) == (
        "did not come today",
        "late today",
    )  # as on the start page
