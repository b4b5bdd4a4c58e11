"""A session as FHIR resources: who walked, what was walked, figures, tests, answers, and by what.

Source: HL7 FHIR 4.0.1 and 4.3.0 (hl7.org/fhir/R4, /R4B), which agree on these. Only what the
standard needs; codes of GARRY's own are in a system of its own, a URN that leads nowhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any, Protocol
from uuid import NAMESPACE_OID, uuid5

from django.conf import settings

from rehab.exports.session_table import CONDITIONS, WALKED, SessionRow
from rehab.people.commands import garry_version
from rehab.people.models import Patient, User
from rehab.sessions.assessment_results import assessments_with
from rehab.sessions.log import PartEntry, SessionEvent, SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse
from rehab.training.changes import State
from rehab.training.summary.metrics import METRICS

SYSTEM = "urn:garry"
LOINC = "http://loinc.org"
UCUM = "http://unitsofmeasure.org"
UCUM_CODES = {
    "": "1",
    "s": "s",
    "m": "m",
    "min": "min",
    "W/kg": "W/kg",
    "days": "d",
    "m/s": "m/s",
    "%": "%",
}
STATUS = {State.FINISHED: "finished", State.ABORTED: "cancelled"}

Resource = dict[str, Any]
# The label of what nobody walked: test health data (HL7 FHIR 4.0.1, security labels).
TEST_DATA: Resource = {
    "meta": {
        "security": [
            {
                "system": "http://terminology.hl7.org/CodeSystem/v3-ActReason",
                "code": "HTEST",
                "display": "test health data",
            }
        ]
    }
}


def label(is_simulated: bool) -> Resource:
    """Return what a resource says of itself where no person stands behind it."""
    return TEST_DATA if is_simulated else {}


class Names(Protocol):
    """How resources are called, and what is said of the patient."""

    shift: timedelta  # of all dates

    def address(self, kind: str, *parts: Any) -> str:
        """Return the address of a resource, the same one for the same thing."""

    def patient(self, patient: Patient) -> tuple[str, Resource]:
        """Return address and resource of a patient."""


class Pseudonyms:
    """Names within one export: addresses that lead nowhere, patients by pseudonym."""

    def __init__(self, shift: timedelta | None = None) -> None:
        self.shift = shift or timedelta()

    def address(self, _kind: str, *parts: Any) -> str:
        """Return a URN."""
        return f"urn:uuid:{uuid5(NAMESPACE_OID, ':'.join(map(str, ('garry', *parts))))}"

    def patient(self, patient: Patient) -> tuple[str, Resource]:
        """Return a patient by pseudonym."""
        known = {"system": f"{SYSTEM}:pseudonym", "value": patient.pseudonym}
        return self.address("Patient", "patient", patient.pseudonym), {
            "resourceType": "Patient",
            "identifier": [known],
        }


class HospitalNames:
    """Names of a server: by what a row is, patients by the clinic's own code."""

    shift = timedelta()

    def address(self, kind: str, *parts: Any) -> str:
        """Return the type and a stable id, such as Encounter/session-12."""
        return f"{kind}/{'-'.join(map(str, parts)).replace('_', '.')}"

    def patient(self, patient: Patient) -> tuple[str, Resource]:
        """Return a patient by the code that the clinic knows them by; at a hospital its number."""
        systems = [f"{SYSTEM}:code"]
        if settings.SMART_IDENTIFIER and not patient.simulated:
            systems.append(settings.SMART_IDENTIFIER)
        return self.address("Patient", "patient", patient.pk), {
            "resourceType": "Patient",
            "identifier": [{"system": system, "value": patient.code} for system in systems],
            "active": patient.ended_at is None,
            **label(patient.simulated),
        }


def make_bundle(user: User, session: TrainingSession, names: Names) -> Resource:
    """Return a session as a bundle of the type "collection"."""
    return {
        "resourceType": "Bundle",
        "type": "collection",
        "timestamp": format_moment(session.began_at + names.shift),
        "entry": [
            {"fullUrl": address, "resource": resource}
            for address, resource in session_resources(user, session, names)
        ],
    }


def make_device(names: Names) -> tuple[str, Resource]:
    """Return address and resource of GARRY itself."""
    return names.address("Device", "garry"), {
        "resourceType": "Device",
        "status": "active",
        "deviceName": [{"name": "GARRY", "type": "model-name"}],
        "version": [{"value": garry_version()}],
    }


def session_resources(
    user: User, session: TrainingSession, names: Names
) -> Iterator[tuple[str, Resource]]:
    """Yield the resources of a session that a user may see, each with its address."""
    patient, about = names.patient(session.patient)
    device, garry = make_device(names)
    yield patient, about
    yield device, garry
    for address, resource in _walk_resources(user, session, names, patient, device):
        yield address, resource | label(session.simulated)


def _walk_resources(
    user: User, session: TrainingSession, names: Names, patient: str, device: str
) -> Iterator[tuple[str, Resource]]:
    shift, began = names.shift, format_moment(session.began_at + names.shift)
    ended = {} if session.ended_at is None else {"end": format_moment(session.ended_at + shift)}
    encounter = names.address("Encounter", "session", session.pk)
    of = {"subject": {"reference": patient}, "encounter": {"reference": encounter}}
    yield (
        encounter,
        {
            "resourceType": "Encounter",
            "identifier": [{"system": f"{SYSTEM}:session", "value": str(session.pk)}],
            "status": STATUS.get(State(session.state), "unknown"),
            "class": {
                "system": "http://terminology.hl7.org/CodeSystem/v3-ActCode",
                "code": "AMB",
            },
            "subject": {"reference": patient},
            "period": {"start": began, **ended},
        },
    )
    by_device = of | {"device": {"reference": device}}
    for slug, label, unit, value in _figures(user, session):
        code = {"system": f"{SYSTEM}:figure", "code": slug, "display": label}
        address = names.address("Observation", "figure", session.pk, slug)
        yield address, _observe({"coding": [code]}, began, value, unit) | by_device
    for row in assessments_with(user, session):
        test = row.definition
        own = {"system": f"{SYSTEM}:test", "code": row.test, "display": test.label}
        loinc = [{"system": LOINC, "code": test.loinc}] if test.loinc else []
        coded = {"coding": [*loinc, own], "text": test.label}
        address = names.address("Observation", "test", session.pk, row.pk)
        observed = _observe(coded, format_moment(row.at + shift), row.value, test.unit) | of
        parts = [{"code": {"text": t}, "valueQuantity": {"value": n}} for t, n in row.answers]
        yield address, observed | ({"component": parts} if parts else {})
    yield from set_goal(session, names)
    for answers in QuestionnaireResponse.objects.visible_to(user).filter(session=session):
        address = names.address("QuestionnaireResponse", "answers", session.pk, answers.pk)
        yield address, _answers(answers, shift) | of
    yield (
        names.address("Provenance", "provenance", session.pk),
        {
            "resourceType": "Provenance",
            "target": [{"reference": encounter}],
            "recorded": ended.get("end", began),
            "agent": [{"who": {"reference": device}}, *_plugins(user, session)],
        },
    )


def set_goal(session: TrainingSession, names: Names) -> Iterator[tuple[str, Resource]]:
    """Yield the goal that a session ended with; none of one without a goal."""
    if session.goal is None:
        return
    measure = session.measure
    code = {"system": f"{SYSTEM}:measure", "code": measure.slug, "display": measure.name}
    reached = {"value": session.goal, **_unit(measure.unit)}
    yield (
        names.address("Goal", "goal", session.patient_id, session.pk),
        {
            "resourceType": "Goal",
            "lifecycleStatus": "completed",
            "description": {"text": f"{measure.name} in training"},
            "subject": {"reference": names.patient(session.patient)[0]},
            "startDate": (session.began_at + names.shift).date().isoformat(),
            "target": [{"measure": {"coding": [code]}, "detailQuantity": reached}],
            **label(session.simulated),
        },
    )


def _observe(code: Resource, at: str, value: float, unit: str) -> Resource:
    return {
        "resourceType": "Observation",
        "status": "final",
        "code": code,
        "effectiveDateTime": at,
        "valueQuantity": {"value": value, **_unit(unit)},
    }


def _plugins(user: User, session: TrainingSession) -> Iterator[Resource]:
    """Yield the parts of other packages that made a session."""
    events = SessionEvent.objects.visible_to(user).filter(session=session, kind=PartEntry.PLUGIN)
    for data in events.order_by("pk").values_list("data", flat=True):
        yield {"who": {"display": "{package} {version}: {name}".format(**data)}}


def _figures(user: User, session: TrainingSession) -> Iterator[tuple[str, str, str, float]]:
    rows = SessionMetric.objects.visible_to(user).filter(session=session).order_by("slug")
    for slug, value in rows.values_list("slug", "value"):
        metric = METRICS.get(slug)
        if metric is not None:
            yield slug, metric.label, metric.unit, value
    row = SessionRow(session, source="")
    for column in (*CONDITIONS, *WALKED):
        if (value := column.get(row)) is not None:
            label = column.name.replace("_", " ").capitalize()
            yield column.name, label, column.unit, value


def _answers(row: QuestionnaireResponse, shift: timedelta) -> dict[str, Any]:
    items = [
        {
            "linkId": str(number),
            "text": item.text,
            **({} if answer is None else {"answer": [{"valueInteger": answer}]}),
        }
        for number, (item, answer) in enumerate(
            zip(row.to_instrument().items, row.all_answers, strict=True), 1
        )
    ]
    return {
        "resourceType": "QuestionnaireResponse",
        "questionnaire": f"{SYSTEM}:questionnaire:{row.slug}",
        "status": "completed" if row.finished_at else "in-progress",
        "authored": format_moment((row.finished_at or row.asked_at) + shift),
        "item": items,
    }


def _unit(unit: str) -> dict[str, str]:
    code = UCUM_CODES.get(unit)
    if code is None:
        return {"unit": unit}
    return {"unit": unit or "1", "system": UCUM, "code": code}


def format_moment(moment: datetime) -> str:
    """Return a moment as FHIR writes it."""
    return moment.isoformat(timespec="seconds")
