"""New patient: the words are shown before they are agreed to, and the language is the clinic's."""

from __future__ import annotations

import re

import pytest

from rehab.people.consent.services import current_text
from rehab.people.models import Clinic, Patient
from tests.support.world import client_of

pytestmark = pytest.mark.django_db


def test_the_words_are_shown_before_they_are_agreed_to(world):
    page = client_of(world).get("/patients/new/").content.decode()
    words = current_text(world.clinic).text.split("\n")[0]
    assert page.index(words[:40]) < page.index('name="consent_care"')


def test_the_paretic_side_is_chosen_and_never_proposed(world):
    client, sides = client_of(world), re.compile(r'<input type="radio" name="paretic_side"[^>]*>')
    found = sides.findall(client.get("/patients/new/").content.decode())
    assert ["checked" in each for each in found] == [False, False]
    Patient.everywhere.filter(pk=world.patient.pk).update(paretic_side="right")
    page = client.get(f"/patients/{world.patient.pk}/details/").content.decode()
    assert [("right" in each, "checked" in each) for each in sides.findall(page)] == [
        (False, False),
        (True, True),
    ]
    answer = client.post("/patients/new/", {"nickname": "Mia", "code": "M-1"})
    assert answer.context["form"].errors.keys() == {"paretic_side"}


@pytest.mark.parametrize(("chosen", "stored"), [({}, "de"), ({"language": "fr"}, "fr")])
def test_a_new_patient_reads_the_clinics_language_or_the_chosen_one(world, chosen, stored):
    Clinic.everywhere.filter(pk=world.clinic.pk).update(language="de")
    data = {"nickname": "Mia", "code": "M-1", "paretic_side": "left"} | chosen
    client = client_of(world)
    client.post("/patients/new/", data)
    patient = Patient.everywhere.get(code="M-1")
    assert patient.language == stored
    client.post(f"/patients/{patient.pk}/details/", data | {"language": ""})
    patient.refresh_from_db()
    assert patient.language == stored


def test_a_new_patient_and_a_code_that_is_taken(pt, patient, world):
    form = {"nickname": "Ann", "code": "K7-9", "paretic_side": "right"}
    answer = pt.post("/patients/new/", form)
    ann = Patient.everywhere.get(code="K7-9")
    assert ann.clinic == world.clinic
    assert answer.headers["Location"] == f"/patients/{ann.pk}/new/"
    page = pt.post("/patients/new/", form).content.decode()
    assert "Code K7-9 already exists: it is Ann&#x27;s." in page
    assert Patient.everywhere.filter(code="K7-9").count() == 1
