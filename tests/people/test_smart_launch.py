"""Whom a health record has open: only a patient of the own clinic, and only where one fits."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from django.urls import reverse
from requests import HTTPError

from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in import sign_on
from rehab.people.sign_in.sign_on import SignOnRefused
from rehab.people.sign_in.smart_launch import find_patient
from tests.support.world import build_world

FHIR, MRN = "https://hospital.example/fhir", "urn:hospital:mrn"
OPEN = {"patient": "pat.1"}


class Record:
    """A health record's FHIR server: what it answers, and what it was asked."""

    def __init__(self) -> None:
        self.resource: Any = {"resourceType": "Patient", "id": "pat.1"}
        self.status = 200
        self.asked: list[str] = []

    def opens(self, *codes: str, **more: str) -> None:
        self.resource["identifier"] = [{"system": MRN, "value": code, **more} for code in codes]

    def get(self, url: str, **_: Any) -> SimpleNamespace:
        self.asked.append(url)
        return SimpleNamespace(json=lambda: self.resource, raise_for_status=self._check)

    def _check(self) -> None:
        if self.status != 200:
            raise HTTPError(str(self.status))


@pytest.fixture
def record(settings, monkeypatch) -> Record:
    settings.OIDC_ISSUER = "https://hospital.example"
    settings.SMART_FHIR, settings.SMART_IDENTIFIER = FHIR, MRN
    made = Record()
    monkeypatch.setattr(sign_on, "client", lambda *_: made)
    return made


@pytest.fixture
def pt(world) -> User:
    found: User = world.people[Role.PT]
    return found


def test_a_patient_is_found_by_the_clinics_code(world, pt, record):
    record.opens(world.patient.code)
    assert find_patient(pt, OPEN) == world.patient
    assert record.asked == [f"{FHIR}/Patient/pat.1"]


def test_nobody_is_opened_unless_exactly_one_fits(world, pt, record):
    code, other = world.patient.code, build_world("basil").patient
    record.opens(other.code)
    assert find_patient(pt, OPEN) is None  # of another clinic
    record.opens(code, use="old")
    assert find_patient(pt, OPEN) is None
    record.opens(code, system="urn:elsewhere")
    assert find_patient(pt, OPEN) is None
    second = Patient.everywhere.create(clinic=world.clinic, code="K7-2", nickname="Ann")
    record.opens(code, second.code)
    assert find_patient(pt, OPEN) is None


def test_a_researcher_learns_no_pseudonym_by_a_code(world, record):
    record.opens(world.patient.code)
    assert find_patient(world.people[Role.RESEARCHER], OPEN) is None
    assert record.asked == []


@pytest.mark.parametrize("name", [None, "", "../Observation/1", "a?b", "x" * 65, ["pat.1"]])
def test_what_is_no_id_of_a_patient_is_not_asked_for(pt, record, name):
    with pytest.raises(SignOnRefused, match="Launch GARRY there again"):
        find_patient(pt, {"patient": name})
    assert record.asked == []


@pytest.mark.parametrize(
    "resource",
    [
        *([], {}, "Patient", {"resourceType": "Patient", "id": "pat.2"}),
        {"resourceType": "OperationOutcome", "id": "pat.1"},
        {"resourceType": "Patient", "id": "pat.1", "identifier": ["K7-1"]},
        {"resourceType": "Patient", "id": "pat.1", "identifier": [{"system": MRN}]},
    ],
)
def test_an_answer_that_says_no_patient_is_refused(pt, record, resource):
    record.resource = resource
    with pytest.raises(SignOnRefused):
        find_patient(pt, OPEN)


def test_a_record_that_refuses_opens_nobody(world, pt, record):
    record.opens(world.patient.code)
    record.status = 401
    with pytest.raises(SignOnRefused):
        find_patient(pt, OPEN)


def test_an_account_of_another_issuer_is_none_of_the_hospitals(rf, record):
    record.authorize_access_token = lambda _request: {
        "userinfo": {"iss": "https://elsewhere.example", "sub": "4711"},
        "id_token": "x",
    }
    record.load_server_metadata = lambda: {"issuer": "https://hospital.example"}
    request = rf.get("/")
    request.session = {sign_on.PURPOSE: {"kind": "launch", "next_url": "", "at": 0}}
    with pytest.raises(SignOnRefused, match="was not completed"):
        sign_on.complete(request)


@pytest.mark.parametrize("issuer", ["", "https://elsewhere.example/fhir", f"{FHIR}x"])
def test_another_record_launches_nothing(world, client, record, issuer):
    assert client.get(reverse("launch"), {"iss": issuer, "launch": "1"}).status_code == 404


def test_without_a_record_nothing_is_launched(world, client, settings):
    assert client.get(reverse("launch"), {"iss": "", "launch": "1"}).status_code == 404
