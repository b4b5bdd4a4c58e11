"""Covariates: given in the forms, kept with patient and session, told to researchers in bands."""

from __future__ import annotations

from datetime import date

import pytest
from django.urls import reverse

from rehab.patients.erasure import erase
from rehab.people.covariates import age_band, months_since
from rehab.people.models import ErasureReason, Patient
from rehab.people.roles import Role
from rehab.sessions.forms.initial import initial_choices
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.walking_conditions import WalkingConditions
from rehab.training.measures import InvalidSetting
from tests.support.world import NOW

pytestmark = pytest.mark.django_db
TODAY = date(2026, 3, 2)


@pytest.mark.parametrize(
    ("born", "band"),
    [(1960, "60-69"), (1957, "60-69"), (1956, "70-79"), (1920, "90+"), (None, ""), (2027, "0-9")],
)
def test_age_is_told_in_bands(born, band):
    assert age_band(born, TODAY) == band


def test_months_since_the_stroke_are_whole_and_never_negative():
    assert months_since(date(2025, 12, 1), TODAY) == 3
    assert months_since(date(2026, 5, 1), TODAY) == 0
    assert months_since(None, TODAY) is None


def test_a_patients_covariates_come_from_the_form_and_leave_with_the_person(world):
    details = {"nickname": "Rosa", "code": "R-1", "paretic_side": "right"}
    details |= {"birth_year": "1958", "stroke_month": "2025-11", "severity": "moderate"}
    url = reverse("edit-patient", args=[world.patient.pk])
    assert world.pt.post(url, details).status_code == 302
    patient = Patient.everywhere.get(pk=world.patient.pk)
    assert patient.birth_year == 1958
    assert patient.stroke_month == date(2025, 11, 1)
    assert patient.severity == "moderate"
    assert 'value="2025-11"' in world.pt.get(url).content.decode()
    erase(patient, ErasureReason.ASKED, None, NOW)
    patient.refresh_from_db()
    assert (patient.birth_year, patient.stroke_month, patient.severity) == (None, None, "")


@pytest.mark.parametrize(
    "wrong",
    [{"birth_year": "2199"}, {"stroke_month": "2199-01"}, {"stroke_month": "1950-01"}],
)
def test_what_cannot_be_of_a_patient_is_refused(world, wrong):
    details = {"nickname": "Rosa", "code": "R-1", "paretic_side": "right", "birth_year": "1958"}
    answer = world.pt.post(reverse("edit-patient", args=[world.patient.pk]), details | wrong)
    assert "errorlist" in answer.content.decode()


def test_the_api_has_covariates_of_patient_and_session(world):
    client = world.pt
    changed = client.patch(
        reverse("api:change_patient", kwargs={"patient_id": world.patient.pk}),
        {"birth_year": 1961, "stroke_month": "2025-11-17", "severity": "mild"},
        content_type="application/json",
    )
    assert (changed.status_code, changed.json()["severity"]) == (200, "mild")
    assert changed.json()["stroke_month"] == "2025-11-01"  # no day is kept
    made = client.post(
        reverse("api:add_session"),
        {
            "patient": world.patient.pk,
            "belt_speed": 0.6,
            "weight_support": 20,
            "device": "cane",
            "source": "live",
            "goal": 1.0,
        },
        content_type="application/json",
    )
    assert made.status_code == 201, made.content
    told = made.json()
    assert (told["belt_speed_m_s"], told["weight_support_percent"]) == (0.6, 20)
    session = TrainingSession.everywhere.get(pk=told["id"])
    assert session.walking == WalkingConditions("cane", 0.6, 20.0)
    again = initial_choices(world.patient, world.people[Role.PT])
    assert (again["belt_speed"], again["device"]) == (0.6, "cane")


@pytest.mark.parametrize(
    "wrong",
    [{"belt_speed_m_s": 60.0}, {"weight_support_percent": 101.0}, {"device": "x" * 65}],
)
def test_what_no_treadmill_does_is_refused(wrong):
    with pytest.raises(InvalidSetting):
        WalkingConditions(**wrong)
