"""A session as a FHIR R4B bundle: patient by pseudonym, what was walked, figures, answers.

Source: HL7 FHIR 4.3.0 (hl7.org/fhir/R4B). Only what the standard needs; codes of GARRY's own are in
a system of its own, a URN that leads nowhere.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_OID, uuid5

from rehab.exports.session_table import CONDITIONS, WALKED, SessionRow
from rehab.people.models import User
from rehab.sessions.assessments import assessments_with
from rehab.sessions.log import SessionMetric
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


def write_bundle(file: Path, user: User, session: TrainingSession, shift: timedelta | None) -> None:
    """Write a session's bundle."""
    made = make_bundle(user, session, shift or timedelta())
    file.write_text(json.dumps(made, ensure_ascii=False, indent=1) + "\n", "utf-8")


def make_bundle(user: User, session: TrainingSession, shift: timedelta) -> dict[str, Any]:
    """Return a session as a bundle of the type "collection", with dates moved by ``shift``."""
    began = _at(session.began_at + shift)
    patient = _uuid("patient", session.patient.pseudonym)
    encounter = _uuid("session", session.pk)
    subject = {"subject": {"reference": patient}, "encounter": {"reference": encounter}}
    ended = {} if session.ended_at is None else {"end": _at(session.ended_at + shift)}
    entries = [
        (
            patient,
            {
                "resourceType": "Patient",
                "identifier": [
                    {"system": f"{SYSTEM}:pseudonym", "value": session.patient.pseudonym}
                ],
            },
        ),
        (
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
        ),
    ]
    for slug, label, unit, value in _figures(user, session):
        observation = {
            "resourceType": "Observation",
            "status": "final",
            "code": {"coding": [{"system": f"{SYSTEM}:figure", "code": slug, "display": label}]},
            "effectiveDateTime": began,
            "valueQuantity": {"value": value, **_unit(unit)},
            **subject,
        }
        entries.append((_uuid("figure", session.pk, slug), observation))
    for row in assessments_with(user, session):
        test, code = row.definition, {"system": f"{SYSTEM}:test", "code": row.test}
        loinc = [{"system": LOINC, "code": test.loinc}] if test.loinc else []
        observation = {
            "resourceType": "Observation",
            "status": "final",
            "code": {"coding": [*loinc, code | {"display": test.label}], "text": test.label},
            "effectiveDateTime": _at(row.at + shift),
            "valueQuantity": {"value": row.value, **_unit(test.unit)},
            **subject,
        }
        entries.append((_uuid("test", row.pk), observation))
    answered = QuestionnaireResponse.objects.visible_to(user).filter(session=session)
    entries += [(_uuid("answers", row.pk), _answers(row, shift) | subject) for row in answered]
    return {
        "resourceType": "Bundle",
        "type": "collection",
        "timestamp": began,
        "entry": [{"fullUrl": url, "resource": resource} for url, resource in entries],
    }


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
        "authored": _at((row.finished_at or row.asked_at) + shift),
        "item": items,
    }


def _unit(unit: str) -> dict[str, str]:
    code = UCUM_CODES.get(unit)
    if code is None:
        return {"unit": unit}
    return {"unit": unit or "1", "system": UCUM, "code": code}


def _at(moment: datetime) -> str:
    return moment.isoformat(timespec="seconds")


def _uuid(*parts: Any) -> str:
    """Return the same address for the same thing within an export."""
    return f"urn:uuid:{uuid5(NAMESPACE_OID, ':'.join(map(str, ('garry', *parts))))}"
