"""Only who is eligible is enrolled, and whoever was assessed is in the log."""

from __future__ import annotations

from datetime import date

import pytest
from django.urls import reverse

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.studies.registration.lifecycle import register
from rehab.studies.results.drawing import FIGURES, TABLES
from rehab.studies.results.results import read_results
from rehab.training.measures import InvalidSetting
from tests.support.studies import draft_study, enrolled, new_patient, running_study
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db
CRITERIA = {"inclusion": "Walks 10 m alone\nFollows two-step orders\n", "exclusion": "Pacemaker"}


def with_stroke(patient: Patient, month: date | None) -> Patient:
    Patient.everywhere.filter(pk=patient.pk).update(stroke_month=month)
    patient.refresh_from_db()
    return patient


def test_a_stroke_that_is_too_recent_is_refused_and_an_unknown_one_asked_for(world):
    study = running_study(world)  # from six months on
    first = NOW.date().replace(day=1)
    recent = first.replace(month=first.month - 2) if first.month > 2 else first
    with pytest.raises(InvalidSetting, match="not eligible: ≥ 6 months since the stroke"):
        enrolled(study, with_stroke(new_patient(world), recent))
    with pytest.raises(InvalidSetting, match="Enter the month"):
        enrolled(study, with_stroke(new_patient(world, 2), None))
    assert not study.enrollments.exists()


def test_every_other_criterion_has_to_be_confirmed(world):
    study = running_study(world, **CRITERIA)
    with pytest.raises(InvalidSetting, match="not eligible: Follows two-step orders; not: Pacem"):
        enrolled(study, new_patient(world), met=["Walks 10 m alone"])
    enrolled(study, new_patient(world, 2), met=study.criteria)
    assert study.enrollments.count() == 1


def test_criteria_are_registered(world):
    version = register(draft_study(world, **CRITERIA), None, NOW)
    assert version.document["inclusion"] == ["Walks 10 m alone", "Follows two-step orders"]
    assert version.document["exclusion"] == ["Pacemaker"]


def test_the_flow_begins_with_everybody_who_was_assessed(world):
    study = running_study(world, **CRITERIA)
    pt = client_of(world, Role.PT)
    url = reverse("enroll", args=[study.pk])
    yes = {"criterion_0": "yes", "criterion_1": "yes", "criterion_2": "no"}
    answers = [
        yes,
        yes | {"takes_part": "no"},
        yes | {"criterion_2": "yes"},
        yes | {"criterion_1": "no", "criterion_2": "yes"},
    ]
    for number, answer in enumerate(answers):
        patient = new_patient(world, number)
        sent = {"patient": patient.pk, "takes_part": "yes", "keep_data": "yes"}
        sent |= {"consent_version": "1", "consented_on": NOW.date().isoformat()} | answer
        page = pt.post(url, sent, follow=True).content.decode()
        assert ("screening log" in page) == (number > 0)
    assert "not enrolled (Follows two-step orders: no; Pacemaker: yes)" in page
    log = page.partition('id="screening"')[2]
    assert all(
        words in " ".join(log.split())
        for words in ("Newcomer 0 – enrolled", "declines", "Pacemaker: yes")
    )
    form = pt.get(url).content.decode()
    assert "Pacemaker</legend>" in form
    assert "not: Pacemaker" not in form
    assert f"{reverse('study', args=[study.pk])}#screening" in form
    assert study.enrollments.count() == 1
    assert study.screenings.count() == 4
    results = read_results(study, NOW)
    flow = FIGURES["flow"](results)
    for words in ("assessed for eligibility: n = 4", "not eligible: n = 2", "declined: n = 1"):
        assert words in flow
    rows = {(row["what"], row["criterion"]): row["people"] for row in TABLES["screening"](results)}
    assert rows["criterion not met", "not: Pacemaker"] == 2
    assert rows["criterion not met", "Follows two-step orders"] == 1
    assert rows["people", ""] == 4
