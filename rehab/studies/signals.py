"""Receivers by which studies follow what happens to their patients."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.db.models.signals import post_save
from django.utils import timezone

from rehab.people.consent.models import Purpose
from rehab.people.consent.services import consent_withdrawn
from rehab.people.models import Patient, User
from rehab.studies.enrolling import withdraw_everywhere


def connect_receivers() -> None:
    """Connect the receivers, when the process starts."""
    consent_withdrawn.connect(on_withdrawal)
    post_save.connect(on_patient, sender=Patient)


def on_withdrawal(
    patient: Patient, purpose: str, by: User | None, now: datetime, **_signal: Any
) -> None:
    """Withdraw from all studies a patient who withdraws consent to research.

    Parameters
    ----------
    patient, purpose
        Who withdraws consent, and to what.
    by, now
        Who records it, and when.
    """
    if purpose == Purpose.RESEARCH:
        withdraw_everywhere(patient, by, now)


def on_patient(
    instance: Patient, raw: bool = False, update_fields: Any = None, **_signal: Any
) -> None:
    """Withdraw an erased patient from all studies.

    Parameters
    ----------
    instance, raw, update_fields
        As Django's ``post_save`` sends them; only a whole save that loads no fixture counts.
    """
    if instance.erased_at is not None and not raw and update_fields is None:
        withdraw_everywhere(instance, None, timezone.now())
