"""A patient's details and screen, as a therapist edits them."""

from __future__ import annotations

import pytest

from rehab.people.models import Patient
from tests.support.walks import make_patient
from tests.support.world import World

pytestmark = pytest.mark.django_db


@pytest.fixture
def patient(world: World) -> Patient:
    return make_patient(world.clinic, code="K7-204")


def test_a_patients_details_can_be_mended_but_not_into_somebody_elses(pt, patient, world):
    url = f"/patients/{patient.pk}/details/"
    other = Patient.everywhere.create(clinic=world.clinic, code="K9", nickname="Anton")
    details = {"nickname": "Rosa", "code": "K9", "paretic_side": "right", "body_mass_kg": ""}
    assert "it is Anton&#x27;s" in pt.post(url, details).content.decode()
    pt.post(url, details | {"code": "K7-205"})
    patient.refresh_from_db()
    assert (patient.code, patient.paretic_side) == ("K7-205", "right")
    other.refresh_from_db()
    assert other.code == "K9"


def test_a_patients_screen_is_kept(pt, patient):
    url = f"/patients/{patient.pk}/screen/"
    assert "Rosa’s screen" in pt.get(url).content.decode()
    answer = pt.post(url, {"screen_side": "left", "screen_text": "large", "screen_still": "on"})
    assert answer.url == f"/patients/{patient.pk}/"
    patient.refresh_from_db()
    kept = (patient.screen_side, patient.screen_still, patient.screen_sounds)
    assert kept == ("left", True, False)
    assert patient.screen_text == "large"
    assert "Select a valid choice" in pt.post(url, {"screen_side": "up"}).content.decode()
