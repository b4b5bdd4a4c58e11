"""The start page: patients are found, and a demo needs none."""

from __future__ import annotations

from datetime import timedelta

import pytest

from rehab.patients.visits import Visit, plan_visit
from rehab.people.models import Patient
from tests.support.clock import HERE
from tests.support.walks import HIT, make_patient, walk
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db


@pytest.fixture
def patient(world: World) -> Patient:
    return make_patient(world.clinic, code="K7-204")


def test_the_demo_is_one_simulated_patient(pt, world):
    places = {pt.post("/patients/demo/").headers["Location"] for _ in range(2)}
    (demo,) = Patient.everywhere.filter(clinic=world.clinic, code="demo")
    assert demo.simulated
    assert places == {f"/patients/{demo.pk}/"}


def test_patients_are_found_by_name_or_code(pt, patient):
    for words in ("ros", "K7-2"):
        assert "Rosa" in pt.get("/start/", {"q": words}).content.decode()
    assert "No patient is called" in pt.get("/start/", {"q": "xyz"}).content.decode()


def test_who_is_late_is_not_proposed(pt, world, patient):
    Visit.everywhere.all().delete()
    plan_visit(patient, HERE.date(), (HERE - timedelta(hours=1)).time())
    page = pt.get("/start/")
    assert "late" in page.content.decode()
    assert "next" not in page.context
    assert "Start training" not in page.content.decode()
    later = make_patient(world.clinic, "Omar", code="K7-300")
    plan_visit(later, HERE.date(), (HERE + timedelta(hours=1)).time())
    page = pt.get("/start/")
    assert page.context["next"].patient == later
    assert "Start training: Omar" in page.content.decode()


def test_simulated_patients_are_last(pt, world, patient):
    walk(make_patient(world.clinic, "Demo", code="demo", simulated=True), "positive", [HIT])
    assert pt.get("/start/").context["patients"][-1].nickname == "Demo"


def test_the_last_sessions_are_listed_with_their_hits(pt, patient):
    session = walk(patient, "positive", [HIT, HIT], now=NOW)
    type(session).everywhere.filter(pk=session.pk).update(active_s=540)
    listed = pt.get("/start/").context["lately"]
    first, day, rate = listed[0]
    assert (first, day, rate) == (session, "today", "100\xa0%")
    type(session).everywhere.filter(pk=session.pk).update(excluded=True)
    assert session.pk not in [one.pk for one, *_ in pt.get("/start/").context["lately"]]
