"""The start page: patients are found, and a demo needs none."""

from __future__ import annotations

import pytest

from rehab.people.models import Patient
from tests.support.walks import make_patient
from tests.support.world import World

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
