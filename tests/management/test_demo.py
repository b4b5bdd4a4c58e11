"""A demonstration has weeks of history and no real people; a problem's report names nobody."""

from __future__ import annotations

from contextlib import suppress
from io import StringIO

import pytest
from django.core.exceptions import ValidationError
from django.core.management import CommandError, call_command
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.boards.panels.shared_panels import BoardViewer
from rehab.management import demo_clinic
from rehab.patients.caseload import Flag, load_caseload
from rehab.patients.first_steps import is_new, look_at_all
from rehab.patients.visits import Progress, patients_today
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day.dashboard import sessions_today
from rehab.sessions.reports.insight import ANY_GOAL, compare, read_view
from tests.support.clock import START as NOW
from tests.support.marks import mark
from tests.support.world import build_world, scoped_models, signed_in

pytestmark = pytest.mark.django_db


@pytest.fixture(scope="module")
def few():
    """Let the patients of a demonstration come thrice."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo_clinic, "VISITS", 3)
        yield


def test_a_demonstration_has_weeks_of_history(few):
    clinic = demo_clinic.fill_clinic("look-around", NOW)
    sessions = TrainingSession.everywhere.filter(clinic=clinic)
    assert sessions.count() == 3 * len(demo_clinic.COURSES)
    assert {one.state for one in sessions} == {"finished"}
    assert len({(one.patient_id, one.created_at.time()) for one in sessions}) == len(
        demo_clinic.COURSES
    )  # each at an hour of their own
    assert max(one.ended_at for one in sessions) < NOW
    assert Step.everywhere.filter(session__in=sessions, hit=True).exists()
    assert SessionMetric.everywhere.filter(session__in=sessions, slug="score").exists()
    assert all(patient.simulated for patient in Patient.everywhere.filter(clinic=clinic))


@pytest.mark.parametrize("is_demo", [True, False], ids=["demonstration", "clinic"])
def test_what_is_simulated_counts_in_a_demonstration_and_nowhere_else(settings, few, is_demo):
    clinic = demo_clinic.fill_clinic("look-around", NOW)
    settings.DEMO = "look-around" if is_demo else ""
    user, now = User.everywhere.get(username="pt"), clinic_time(NOW, clinic)
    cases = load_caseload(user, now)
    assert {flag for case in cases for flag in case.flags} == (set(Flag) if is_demo else set())
    view = read_view(user, {}, NOW)
    assert bool(view.shown) == bool(compare(view.shown, view.by)) == is_demo
    assert any(one.note for one in read_view(user, {"goal": ANY_GOAL}, NOW).shown) == is_demo
    walked = {one.progress for one in patients_today(user, now)}
    assert (Progress.DONE in walked) == is_demo
    assert Progress.EXPECTED in walked  # a visit that was planned is one
    assert is_new(user) != is_demo
    assert look_at_all(user, NOW)["patient"].is_done == is_demo
    today = sessions_today(user, clinic, NOW)
    assert bool(today) == is_demo
    boards = {
        one.name: BoardViewer(one, NOW, staff=True).make_panel()
        for one in Leaderboard.everywhere.all()
    }
    assert bool(boards["Steps at the goal"].rows) == is_demo
    assert (boards["Minutes together"].total is not None) == is_demo


@pytest.mark.parametrize(("name", "code"), [("Rosa Weber", "demo-9"), ("Amber", "K7-204")])
def test_it_refuses_real_names(settings, name, code):
    clinic = build_world("amber").clinic
    patient = Patient(clinic=clinic, nickname=name, code=code, paretic_side="left")
    patient.full_clean()
    settings.DEMO = "look-around"
    with pytest.raises(ValidationError, match="demonstration"):
        patient.full_clean()
    Patient(clinic=clinic, nickname="Fern", code="demo-9", paretic_side="left").full_clean()


def test_its_sign_in_page_tells_the_password_and_no_other_does(settings, client):
    page = client.get(reverse("sign-in")).content.decode()
    assert "demonstration" not in page
    settings.DEMO = "gufo-pepa-rozo"
    page = client.get(reverse("sign-in")).content.decode()
    assert "Sign in as lead, pt, researcher; the password is gufo-pepa-rozo." in page


def test_it_never_fills_another_database(settings):
    with pytest.raises(CommandError, match="garry demo"):
        call_command("demo", "--fill")
    settings.HOSTED = True
    with pytest.raises(CommandError, match="elsewhere"):
        call_command("demo")


def test_a_report_of_a_problem_names_nobody(settings, tmp_path, monkeypatch):
    settings.DATA_DIR = tmp_path
    world = build_world("amber")
    monkeypatch.setenv("GARRY_SECRET_KEY", "not-to-be-told")
    with suppress(SystemExit):  # where this machine lacks something
        call_command("doctor", report=tmp_path / "problem.txt", stdout=StringIO())
    text = (tmp_path / "problem.txt").read_text()
    assert "rehab.patient: " in text
    assert "GARRY_SECRET_KEY" in text
    for secret in ("not-to-be-told", str(tmp_path), world.patient.pseudonym, world.patient.code):
        assert secret not in text
    for model in scoped_models():
        assert mark("amber", model) not in text


def test_who_answers_for_the_server_has_the_report_from_its_pages(world):
    lead, pt = signed_in(world.people[Role.LEAD]), world.pt
    assert "Report a problem" in lead.get("/help/").content.decode()
    assert "Report a problem" not in pt.get("/help/").content.decode()
    answer = lead.get("/problem-report/")
    assert "attachment" in answer.headers["Content-Disposition"]
    text = answer.content.decode()
    assert "rehab.patient: " in text
    assert world.patient.code not in text
    assert pt.get("/problem-report/").status_code == 403
    Clinic.everywhere.create(name="Another clinic, whose rows would be counted, too")
    assert lead.get("/problem-report/").status_code == 403
    assert "Report a problem" not in lead.get("/help/").content.decode()
    host = signed_in(User.everywhere.create_superuser("root"))
    assert host.get("/problem-report/").status_code == 200
