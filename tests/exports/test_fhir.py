"""FHIR: read by a hospital, sent to its server, and never beyond clinic and consent."""

from __future__ import annotations

import json
import re
from datetime import timedelta
from typing import Any

import pytest
from django.urls import reverse

from rehab.outbox.delivery import deliver_due, is_due
from rehab.outbox.http_post import Answer
from rehab.outbox.models import Endpoint, OutboxMessage
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Clinic
from rehab.people.roles import Role
from rehab.people.sign_in.step_up import CONFIRMED_AT
from rehab.studies.blinding import Task, give_mark
from rehab.studies.participants import Enrollment
from rehab.studies.record.adverse_events import AdverseEvent
from rehab.studies.registration.lifecycle import close
from tests.support.clock import START as NOW
from tests.support.programs import ROOT, program_of
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.walks import walk
from tests.support.world import build_world, client_of

pytestmark = pytest.mark.django_db
KINDS = (
    *("Patient", "Encounter", "Observation", "QuestionnaireResponse", "Provenance", "Device"),
    *("ResearchStudy", "ResearchSubject", "AdverseEvent", "Goal"),
)


def read(world, path, role=Role.PT):
    return program_of(world, role).client.get(f"{ROOT}/fhir/{path}")


def resources(answer):
    assert answer.status_code == 200, answer.content
    assert answer.headers["Content-Type"] == "application/fhir+json"
    return [entry["resource"] for entry in json.loads(answer.content).get("entry", ())]


@pytest.mark.parametrize("kind", KINDS)
def test_every_resource_is_valid_and_has_an_address_of_its_own(world, kind):
    fhir = pytest.importorskip("fhir.resources.R4B")
    bundle = pytest.importorskip("fhir.resources.R4B.bundle").Bundle
    answer = read(world, kind)
    bundle.model_validate_json(answer.content)
    found = resources(answer)
    assert found
    for resource in found:
        assert resource["resourceType"] == kind
        assert fhir.get_fhir_model_class(kind).model_validate(resource).id == resource["id"]
        alone = read(world, f"{kind}/{resource['id']}")
        assert json.loads(alone.content) == resource


def test_its_abilities_are_stated(world):
    statement = pytest.importorskip("fhir.resources.R4B.capabilitystatement").CapabilityStatement
    told = statement.model_validate_json(read(world, "metadata").content)
    assert {one.type for one in told.rest[0].resource} == set(KINDS)


def test_no_arm_is_told_before_the_study_is_closed_and_an_assessor_reads_no_event(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    told = AdverseEvent.everywhere.create(
        enrollment=enrollment, what="fell over", grade=4, relation="none"
    )
    mine = f"patient={enrollment.patient_id}"
    subject = f"ResearchSubject/subject-{enrollment.pk}"

    def all_of_it(role=Role.PT):
        of_study = json.loads(read(world, f"ResearchStudy/study-{study.pk}", role).content)
        found = [json.loads(read(world, subject, role).content), of_study]
        return [*found, *resources(read(world, f"AdverseEvent?patient=patient-{mine[8:]}", role))]

    one, of_study, event = all_of_it()
    assert (one["status"], of_study["status"]) == ("on-study", "active")
    assert (event["id"], event["event"]) == (f"event-{told.pk}", {"text": "fell over"})
    assert event["seriousness"]["coding"][0]["code"] == "serious"
    assert not {"assignedArm", "arm"} & {*one, *of_study}
    give_mark(study, world.people[Role.PT], Task.ASSESSOR, None, NOW)
    assert [one["resourceType"] for one in all_of_it()] == ["ResearchSubject", "ResearchStudy"]
    close(study, None, NOW)
    one, of_study, event = all_of_it()
    assert one["assignedArm"] == enrollment.allocation.group
    assert [arm["name"] for arm in of_study["arm"]] == ["A", "B"]
    assert event["event"]["text"] == f"fell over ({enrollment.allocation.group})"


def test_a_patients_own_goal_and_the_set_one_are_goals(world):
    type(world.patient).everywhere.filter(pk=world.patient.pk).update(own_goal="To the bakery")
    session = walk(world.patient, "binary", [4.0] * 4)
    goals = resources(read(world, f"Goal?patient=patient-{world.patient.pk}"))
    texts = {one["id"]: one for one in goals}
    own = texts[f"goal-{world.patient.pk}"]
    assert own["description"] == {"text": "To the bakery"}
    (target,) = texts[f"goal-{world.patient.pk}-{session.pk}"]["target"]
    assert target["detailQuantity"]["value"] == session.goal
    assert target["detailQuantity"]["code"] == "W/kg"


def test_a_hospital_finds_its_patient_by_code_and_what_was_walked(world):
    session = walk(world.patient, "binary", [4.0] * 4)
    code = world.patient.code
    (patient,) = resources(read(world, f"Patient?identifier=urn:garry:code|{code}"))
    assert patient["id"] == f"patient-{world.patient.pk}"
    assert resources(read(world, "Patient?identifier=urn:other|1")) == []
    walked = resources(read(world, f"Encounter?patient=Patient/{patient['id']}"))
    assert f"session-{session.pk}" in [one["id"] for one in walked]
    figures = resources(read(world, f"Observation?encounter=session-{session.pk}"))
    score = next(one for one in figures if one["id"] == f"figure-{session.pk}-score")
    assert score["encounter"] == {"reference": f"Encounter/session-{session.pk}"}


def test_a_hospital_finds_its_patient_by_its_own_identifier(world, settings):
    code, system = world.patient.code, "urn:hospital:mrn"
    assert resources(read(world, f"Patient?identifier={system}|{code}")) == []
    settings.SMART_IDENTIFIER = system
    (patient,) = resources(read(world, f"Patient?identifier={system}|{code}"))
    assert {"system": system, "value": code} in patient["identifier"]
    type(world.patient).everywhere.filter(pk=world.patient.pk).update(simulated=True)
    for patient in resources(read(world, "Patient")):  # who is simulated has no number there
        assert system not in [one["system"] for one in patient["identifier"]]


def test_a_page_leads_to_the_next(world):
    for _ in range(3):
        walk(world.patient, "binary", [4.0] * 4)
    seen, path = [], "Encounter?_count=2"
    for _ in range(5):
        bundle = json.loads(read(world, path).content)
        seen += [entry["resource"]["id"] for entry in bundle["entry"]]
        more = [link["url"] for link in bundle["link"] if link["relation"] == "next"]
        if not more:
            break
        path = more[0].partition("/fhir/")[2]
    assert len(seen) == len(set(seen)) == 4


def test_nothing_of_another_clinic_is_read_searched_or_exported(world):
    other = build_world("basil")
    session, patient = world.session.pk, world.patient.pk
    names = {
        "Patient": f"patient-{patient}",
        "Encounter": f"session-{session}",
        "Observation": f"figure-{session}-score",
        "Provenance": f"provenance-{session}",
        "Goal": f"goal-{patient}-{session}",
        "ResearchSubject": f"subject-{Enrollment.everywhere.get(patient=patient).pk}",
        "AdverseEvent": f"event-{AdverseEvent.everywhere.get(enrollment__patient=patient).pk}",
    }
    for kind, name in names.items():
        assert read(world, f"{kind}/{name}").status_code == 200
        assert read(other, f"{kind}/{name}").status_code == 404
    assert resources(read(other, f"Patient?identifier={world.patient.code}")) == []
    assert resources(read(other, f"Observation?patient=patient-{patient}")) == []
    for role in (Role.LEAD, Role.PT):
        for kind in KINDS:
            text = bulk(other, kind, role)
            assert not {f'"{name}"' for name in names.values()} & set(re.findall(r'"[^"]*"', text))
            assert world.patient.code not in text


@pytest.mark.parametrize(
    "name", ["", "x", "patient-", "patient-x", "patient-²", "patient-" + "9" * 30]
)
def test_an_impossible_id_is_none_of_ours(world, name):
    assert read(world, f"Patient/{name}").status_code == 404 or not name
    assert read(world, f"Encounter?patient={name or '-'}").status_code == 404


def test_without_consent_to_care_there_is_no_patient(world):
    Clinic.everywhere.filter(pk=world.clinic.pk).update(care_needs_consent=True)
    assert resources(read(world, "Patient")) == []
    assert resources(read(world, "Observation")) == []
    record_consent(world.patient, Purpose.CARE, None, NOW)
    assert resources(read(world, "Patient"))


def test_researchers_read_no_names(world):
    assert read(world, "Patient", Role.RESEARCHER).status_code == 403


def bulk(world, kind, role=Role.PT):
    program = program_of(world, role).client
    begun = program.get(f"{ROOT}/fhir/$export", headers={"prefer": "respond-async"})
    assert begun.status_code == 202
    manifest = program.get(begun.headers["Content-Location"]).json()
    (url,) = (one["url"] for one in manifest["output"] if one["type"] == kind)
    answer: Any = program.get(url)
    assert answer.headers["Content-Type"] == "application/fhir+ndjson"
    return b"".join(answer.streaming_content).decode()


def test_the_whole_clinic_is_exported_a_line_each(world):
    fhir = pytest.importorskip("fhir.resources.R4B")
    for kind in KINDS:
        lines = bulk(world, kind).splitlines()
        assert lines
        for line in lines:
            fhir.get_fhir_model_class(kind).model_validate_json(line)


@pytest.mark.parametrize("path", ["bulk/Patient.ndjson?before=2100-01-01T00:00:00Z", "$export"])
def test_an_open_screen_does_not_let_the_whole_clinic_out(world, path):
    browser = client_of(world)
    store = browser.session
    shown_at = store[CONFIRMED_AT]
    store[CONFIRMED_AT] = 0
    store.save()
    refused = browser.get(f"{ROOT}/fhir/{path}")
    assert refused.status_code == 403
    assert reverse("confirm") in refused.json()["message"]
    store[CONFIRMED_AT] = shown_at
    store.save()
    assert browser.get(f"{ROOT}/fhir/{path}").status_code in (200, 202)
    noted = AuditEntry.everywhere.filter(act=Act.EXPORT, clinic=world.clinic)
    assert [one.about.rpartition("/")[2] for one in noted] == (
        ["Patient.ndjson"] if "bulk" in path else []
    )


class FhirServer:
    """Stores what is put, as a server does that knows transactions."""

    def __init__(self):
        self.stored = {}
        self.is_away = True
        self.asked = []

    def __call__(self, url, body, headers, _allowed):
        if self.is_away:
            raise OSError("no route")
        self.asked.append((url, headers))
        bundle = json.loads(body)
        assert bundle["type"] == "transaction"
        for entry in bundle["entry"]:
            kind, _, name = entry["request"]["url"].partition("/")
            assert (kind, name) == (entry["resource"]["resourceType"], entry["resource"]["id"])
            self.stored[entry["request"]["url"]] = entry["resource"]
        return Answer(200, "")


@pytest.fixture
def endpoint(world):
    endpoint = Endpoint(
        clinic=world.clinic,
        name="EHR",
        kind=Endpoint.Kind.FHIR,
        url="https://ehr.example/fhir",
    )
    endpoint.store_secret("ehr-token")
    endpoint.save()
    return endpoint


def test_a_push_survives_an_hour_away_and_repeats_change_nothing(world, endpoint):
    sessions = [walk(world.patient, "binary", [4.0] * 4) for _ in range(3)]
    server, now = FhirServer(), NOW
    while now < NOW + timedelta(hours=1):
        deliver_due(now, server)
        now += timedelta(seconds=30)
    server.is_away = False
    while is_due(now) or OutboxMessage.everywhere.filter(state="waiting").exists():
        now += timedelta(minutes=10)
        deliver_due(now, server)
    once = dict(server.stored)
    assert {f"Encounter/session-{session.pk}" for session in sessions} <= once.keys()
    references = json.dumps(list(once.values()))
    assert f'"Patient/patient-{world.patient.pk}"' in references
    assert server.asked[0][1]["Authorization"] == "Bearer ehr-token"
    for message in OutboxMessage.everywhere.filter(endpoint=endpoint):
        message.send_again(now)
    deliver_due(now, server)
    assert server.stored == once


def test_what_is_sent_is_valid_and_what_is_read_is_the_same(world, endpoint):
    bundle = pytest.importorskip("fhir.resources.R4B.bundle").Bundle
    walk(world.patient, "binary", [4.0] * 4)
    sent = []

    def keep(_url, body, *_):
        sent.append(body)
        return Answer(200, "")

    deliver_due(NOW + timedelta(hours=1), keep)
    assert bundle.model_validate_json(sent[0]).entry
    for entry in json.loads(sent[0])["entry"]:
        answer = read(world, entry["request"]["url"])
        assert json.loads(answer.content) == entry["resource"]


def test_what_a_running_study_hides_is_sent_when_it_is_closed(world, endpoint):
    """An assessor may read the hospital's record, where points and hits would tell the arm."""
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    walk(enrollment.patient, "binary", [4.0] * 4)
    server = FhirServer()
    server.is_away = False
    assert deliver_due(NOW + timedelta(hours=1), server) == 0
    (message,) = OutboxMessage.everywhere.filter(endpoint=endpoint)
    assert (message.state, server.stored) == ("refused", {})
    assert "once the study is closed" in message.answer
    type(study).everywhere.filter(pk=study.pk).update(state="closed")
    message.send_again(NOW)
    assert deliver_due(NOW + timedelta(hours=2), server) == 1
    assert f"Encounter/session-{message.body['session']}" in server.stored


def test_an_erased_patient_and_a_refusal_are_shown_and_not_repeated(world, endpoint):
    first, second = (walk(world.patient, "binary", [4.0] * 4) for _ in range(2))
    type(first).everywhere.filter(pk=first.pk).update(excluded=True)

    def refuse(*_):
        issue = {"code": "invalid", "diagnostics": "Rosa", "expression": ["Patient.identifier"]}
        return Answer(422, json.dumps({"issue": [issue]}))

    for minutes in (60, 120):
        deliver_due(NOW + timedelta(minutes=minutes), refuse)
    rows = {row.body["session"]: row for row in OutboxMessage.everywhere.filter(endpoint=endpoint)}
    assert rows[first.pk].answer == "A correction took the session out."
    assert rows[second.pk].answer == "422 invalid Patient.identifier"  # without its words
    assert {row.state for row in rows.values()} == {"refused"}


def test_what_nobody_walked_is_labeled_and_not_sent_of_a_person(world, endpoint):
    session = walk(world.patient, "binary", [4.0] * 4)
    type(session).everywhere.filter(pk=session.pk).update(simulated=True)
    deliver_due(NOW + timedelta(hours=1), FhirServer())
    (message,) = OutboxMessage.everywhere.filter(endpoint=endpoint)
    assert (message.state, message.answer) == ("refused", "Nobody walked: it was simulated.")
    figures = resources(read(world, f"Observation?encounter=session-{session.pk}"))
    assert {one["meta"]["security"][0]["code"] for one in figures} == {"HTEST"}
    (patient,) = resources(read(world, f"Patient?identifier=urn:garry:code|{world.patient.code}"))
    assert "meta" not in patient
