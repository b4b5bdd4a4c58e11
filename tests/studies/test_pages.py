"""The pages of studies: seen by whom they may be, told on the record."""

from __future__ import annotations

import re
from typing import Any

import pytest
from django.test import Client
from django.urls import reverse

from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station
from rehab.studies.participants import Enrollment
from rehab.studies.registration.lifecycle import close
from tests.support.studies import (
    draft_study,
    enrolled,
    hide_from,
    new_patient,
    refusals,
    running_study,
    text_of,
)
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db
SIGNED = {
    "keep_data": "yes",
    "takes_part": "yes",
    "consent_version": "1.0",
    "consented_on": NOW.date().isoformat(),
}


# --- participants ---------------------------------------------------------------------------------


def start_visit(client: Client, enrollment: Enrollment) -> Any:
    page = client.get(reverse("participant", args=[enrollment.pk]))
    return press_start(client, enrollment, shown_visit(page))


def shown_visit(page: Any) -> str:
    found = re.search(r'name="visit" value="(\d+)"', page.content.decode())
    return found[1] if found else ""


def press_start(client: Client, enrollment: Enrollment, visit: str) -> Any:
    station = Station.everywhere.filter(clinic=enrollment.clinic).first()
    where = {"station": station.pk, "source": "live", "visit": visit, "heart_rate_limit": 130}
    return client.post(reverse("start-visit", args=[enrollment.pk]), where)


def test_a_patient_is_enrolled_and_walks_the_arm_without_it_being_named(world, caplog):
    study = running_study(world)
    patient = new_patient(world)
    pt = client_of(world)
    url = reverse("enroll", args=[study.pk])
    assert "required" in text_of(pt.post(url, {"patient": patient.pk}))
    sent = pt.post(url, SIGNED | {"patient": patient.pk})
    enrollment = Enrollment.everywhere.get(patient=patient)
    assert sent["Location"] == reverse("participant", args=[enrollment.pk])
    page = text_of(pt.get(sent["Location"]))
    assert "Start visit 1" in page
    assert "positive" not in page.lower()
    assert "negative" not in page.lower()
    session = TrainingSession.everywhere.exclude(pk=world.session.pk)
    assert start_visit(pt, enrollment).url == reverse("monitor", args=[session.get().pk])
    assert session.get().to_plan().heart_rate_limit == 130
    assert "One study a patient" in text_of(
        pt.post(url, SIGNED | {"patient": patient.pk, "keep_data": "no"})
    )
    assert refusals(caplog) == [f"Refused to account {world.people[Role.PT].pk}: {url}"]


def test_an_old_page_starts_no_visit_but_the_one_that_it_shows(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    pt = client_of(world)
    old = shown_visit(pt.get(reverse("participant", args=[enrollment.pk])))
    assert press_start(pt, enrollment, old).status_code == 302
    assert "still has an open session" in text_of(press_start(pt, enrollment, old))
    first = TrainingSession.everywhere.filter(study_visit__enrollment=enrollment)
    first.update(state="finished")
    assert "Someone else" in text_of(press_start(pt, enrollment, old))
    assert first.count() == 1


def test_an_arm_is_revealed_with_a_reason_and_the_lead_can_read_who_asked(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    pt, url = client_of(world), reverse("reveal", args=[enrollment.pk])
    assert pt.post(url, {"reason": ""}).status_code == 403
    shown = text_of(pt.post(url, {"reason": "dizzy", "emergency": "yes", "alone": "yes"}))
    arm = study.arms.get(code=enrollment.allocation.group)
    assert arm.name in shown
    entry = AuditEntry.everywhere.get(act=Act.UNBLIND)
    assert (entry.by, entry.patient) == (world.people[Role.PT], enrollment.patient)
    told = text_of(client_of(world, Role.LEAD).get(reverse("study", args=[study.pk])))
    assert "dizzy" in told
    assert "emergency" in told


CONDITIONS = ("positive", "negative", "feedback")


def test_an_assessor_reads_participants_and_visits_and_no_condition(world):
    study = running_study(world)
    assessor = hide_from(study, world)
    enrollment = enrolled(study, new_patient(world))
    start_visit(client_of(world), enrollment)
    for name, key in (("study", study.pk), ("participant", enrollment.pk)):
        page = text_of(assessor.get(reverse(name, args=[key])))
        main = page.partition("<main")[2].lower()
        assert enrollment.code.lower() in main
        assert not [word for word in CONDITIONS if word in main], name
        assert "/monitor/" not in main
    assert assessor.get(reverse("study-protocol", args=[study.pk])).status_code == 403
    refused = assessor.post(reverse("reveal", args=[enrollment.pk]), {"reason": "curious"})
    assert refused.status_code == 403
    assert "Ask a lead" in text_of(refused)
    assert study.events.filter(kind="refused").count() == 1
    assert "You assess" in text_of(start_visit(assessor, enrolled(study, new_patient(world, 2))))


def test_a_researcher_reads_codes_and_pseudonyms_alone(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    page = text_of(client_of(world, Role.RESEARCHER).get(reverse("study", args=[study.pk])))
    assert enrollment.code in page
    assert enrollment.patient.pseudonym in page
    assert enrollment.patient.nickname not in page


def test_groups_are_told_once_the_study_is_closed(world):
    study = running_study(world)
    enrolled(study, new_patient(world))
    lead, url = client_of(world, Role.LEAD), reverse("study", args=[study.pk])
    row = rf"<td[^>]*>\s*{study.enrollments.get().allocation.group}\s*</td>"
    assert not re.search(row, text_of(lead.get(url)))
    close(study, None, NOW)
    assert re.search(row, text_of(lead.get(url)))


def test_a_draft_is_the_leads_alone(world):
    study = draft_study(world)
    assert client_of(world).get(reverse("study", args=[study.pk])).status_code == 403
    assert study.title not in text_of(client_of(world).get(reverse("studies")))


def test_marks_are_given_and_taken_by_the_lead(world):
    study = running_study(world)
    lead, url = client_of(world, Role.LEAD), reverse("study-marks", args=[study.pk])
    pt = world.people[Role.PT]
    lead.post(url, {"user": pt.pk, "task": "assessor"})
    mark = study.marks.get(user=pt)
    assert "another role" in text_of(
        lead.post(url, {"user": pt.pk, "task": "interim"}, follow=True)
    )
    lead.post(url, {"take": mark.pk})
    mark.refresh_from_db()
    assert mark.ended_at is not None


def test_leaving_by_the_page_ends_the_blinding(world):
    enrollment = enrolled(running_study(world), new_patient(world))
    client_of(world).post(reverse("leave-study", args=[enrollment.pk]), {"reason": "too far"})
    patient = Patient.everywhere.get(pk=enrollment.patient_id)
    assert not patient.blinded
    assert enrollment.events.last().reason == "too far"
