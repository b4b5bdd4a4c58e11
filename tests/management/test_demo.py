"""A demonstration has weeks of history and no real people; a problem's report names nobody."""

from __future__ import annotations

from contextlib import suppress
from io import StringIO

import pytest
from django.core.exceptions import ValidationError
from django.core.management import CommandError, call_command

from rehab.management import demo_clinic
from rehab.people.models import Patient
from rehab.people.models.choices import DEMO_NAMES
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from tests.support.clock import START as NOW
from tests.support.marks import mark
from tests.support.world import build_world, scoped_models

pytestmark = pytest.mark.django_db


def test_a_demonstration_has_weeks_of_history(monkeypatch):
    monkeypatch.setattr(demo_clinic, "STRIDES", 60)
    monkeypatch.setattr(demo_clinic, "WEEKS", 2)
    clinic = demo_clinic.fill_clinic("look-around", NOW)
    sessions = TrainingSession.everywhere.filter(clinic=clinic)
    assert sessions.count() == 2 * 3 * len(DEMO_NAMES)
    assert {one.state for one in sessions} == {"finished"}
    assert max(one.ended_at for one in sessions) < NOW
    assert Step.everywhere.filter(session__in=sessions, hit=True).exists()
    assert SessionMetric.everywhere.filter(session__in=sessions, slug="score").exists()
    assert all(patient.simulated for patient in Patient.everywhere.filter(clinic=clinic))


@pytest.mark.parametrize(("name", "code"), [("Rosa Weber", "demo-9"), ("Amber", "K7-204")])
def test_it_refuses_real_names(settings, name, code):
    clinic = build_world("amber").clinic
    patient = Patient(clinic=clinic, nickname=name, code=code, paretic_side="left")
    patient.full_clean()
    settings.DEMO = True
    with pytest.raises(ValidationError, match="demonstration"):
        patient.full_clean()
    Patient(clinic=clinic, nickname="Fern", code="demo-9", paretic_side="left").full_clean()


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
