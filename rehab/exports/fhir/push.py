"""A session as one transaction for a FHIR server, from the outbox."""

from __future__ import annotations

import json
from datetime import datetime
from typing import Any

from rehab.exports.fhir.resources import HospitalNames, session_resources
from rehab.outbox.delivery import WRITERS, NothingToSend, Request
from rehab.outbox.models import Endpoint, OutboxMessage
from rehab.people.consent.services import is_care_allowed
from rehab.people.models import User
from rehab.people.models.hidden_patients import is_in_running_study
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession


def make_transaction(user: User, session: TrainingSession) -> dict[str, Any]:
    """Return a bundle that puts each resource at its own place: repeated, it changes nothing."""
    names = HospitalNames()
    return {
        "resourceType": "Bundle",
        "type": "transaction",
        "entry": [
            {
                "resource": resource | {"id": address.partition("/")[2]},
                "request": {"method": "PUT", "url": address},
            }
            for address, resource in session_resources(user, session, names)
        ],
    }


def write_session(message: OutboxMessage, _now: datetime) -> Request:
    """Return the session of a message as it is now. Raises NothingToSend."""
    rows = TrainingSession.everywhere.filter(clinic=message.clinic_id, pk=message.body["session"])
    session = rows.select_related("patient__clinic", "measure", "clinic").first()
    if session is None or session.patient.erased_at is not None:
        raise NothingToSend("The patient was erased.")
    if not is_care_allowed(session.patient):
        raise NothingToSend("The patient has not agreed to care.")
    if session.excluded:
        raise NothingToSend("A correction took the session out.")
    if session.simulated and not session.patient.simulated:
        raise NothingToSend("Nobody walked: it was simulated.")
    if is_in_running_study(session.patient):  # assessors may read the hospital's record
        raise NothingToSend(
            "A running study has the patient, and this would tell the arm. "
            "Send it again once the study is closed."
        )
    # What a lead sees from whom no study hides anything; nobody can sign in as this.
    reader = User(pk=0, role=Role.LEAD, clinic=session.clinic, is_active=True)
    body = json.dumps(make_transaction(reader, session), ensure_ascii=False).encode()
    token = message.endpoint.open_secret()
    authorization = {"Authorization": f"Bearer {token}"} if token else {}
    return Request(body, {"Content-Type": "application/fhir+json"} | authorization)


def install_writer() -> None:
    """Let the outbox send sessions to FHIR servers."""
    WRITERS[Endpoint.Kind.FHIR] = write_session
