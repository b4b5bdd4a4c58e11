"""How a patient's time with GARRY ends: the program for now, what leads to the person for good.

An erased patient stays as figures under a new false name: sessions, steps and what boards never
show. Nobody can undo it; backups made before still hold the person (docs/privacy.md).
"""

from __future__ import annotations

from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext as _

from rehab.people.models import Ending, Patient
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES


class StillOpen(ValueError):
    """A patient whose time cannot end while a session is open."""


def end_program(patient: Patient, because: Ending, now: datetime) -> None:
    """Take a patient off the lists; nothing can be started until it is reopened.

    Raises StillOpen.
    """
    with transaction.atomic():
        hold_closed(patient)
        if patient.erased_at is None:
            patient.ended_at, patient.ended_because = now, because
            patient.save(update_fields=["ended_at", "ended_because"])


def reopen_program(patient: Patient) -> None:
    """Put a patient back on the lists. An erased one stays away: nobody is there to come back."""
    with transaction.atomic():
        patient.hold()
        if patient.erased_at is None:
            patient.ended_at, patient.ended_because = None, ""
            patient.save(update_fields=["ended_at", "ended_because"])


def hold_closed(patient: Patient) -> None:
    """Hold the patient's row. Raises StillOpen where a session could still go on."""
    patient.hold()
    sessions = TrainingSession.everywhere.filter(
        patient=patient, state__in=[state.value for state in OPEN_STATES]
    )
    if sessions.exists():
        said = _("%(patient)s still has an open session. End it first.")
        raise StillOpen(said % {"patient": patient.nickname})
