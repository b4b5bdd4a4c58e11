"""Ending and reopening a patient's program.

An erased patient (`erasure`) stays as sessions and steps under a new pseudonym. That cannot be
undone; backups made before still contain the person (docs/privacy.md).
"""

from __future__ import annotations

from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext as _

from rehab.patients.family import end_links
from rehab.people.models import EndReason, Patient, User
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES


class SessionStillOpen(ValueError):
    """The patient has an open session, which must be ended first."""


def end_program(patient: Patient, reason: EndReason, now: datetime, by: User | None = None) -> None:
    """End a patient's program, and the links to it; until it is reopened, no session can be set up.

    Raises SessionStillOpen.
    """
    with transaction.atomic():
        lock_without_open_session(patient)
        if patient.erased_at is None:
            patient.ended_at, patient.end_reason = now, reason
            patient.save(update_fields=["ended_at", "end_reason"])
            end_links(patient, by, now)


def reopen_program(patient: Patient) -> None:
    """Reopen a patient's program; an erased patient's stays ended."""
    with transaction.atomic():
        patient.lock()
        if patient.erased_at is None:
            patient.ended_at, patient.end_reason = None, ""
            patient.save(update_fields=["ended_at", "end_reason"])


def lock_without_open_session(patient: Patient) -> None:
    """Lock the patient's row. Raises SessionStillOpen where a session is open."""
    patient.lock()
    sessions = TrainingSession.everywhere.filter(
        patient=patient, state__in=[state.value for state in OPEN_STATES]
    )
    if sessions.exists():
        message = _("%(patient)s still has an open session. End it first.")
        raise SessionStillOpen(message % {"patient": patient.nickname})
