"""Erasure of what identifies a person."""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime

from django.contrib.admin.models import LogEntry
from django.contrib.contenttypes.models import ContentType
from django.db import DatabaseError, connection, transaction
from django.db.models import Model

from rehab.patients.closure import lock_without_open_session
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.audit.history import erase_values
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.consent.tombstones import block_reimport
from rehab.people.field_policy import (
    Erasure,
    erased_values,
    erasers_of,
    paths_to_patient,
    policies_of,
)
from rehab.people.models import ErasureReason, Patient, User
from rehab.sessions.seals import replace_seals


def erase(patient: Patient, reason: ErasureReason, by: User | None, now: datetime) -> None:
    """Erase everything that identifies a person, permanently. Raises SessionStillOpen.

    What becomes of each field stands beside it (`rehab.people.field_policy`).
    """
    with transaction.atomic():
        transaction.on_commit(_empty_journal)
        lock_without_open_session(patient)
        if patient.erased_at is not None:
            return  # by another request, meanwhile
        withdraw_consent(patient, Purpose.BOARDS, by, now)
        pseudonym = patient.pseudonym
        if patient.legacy_id is not None:
            block_reimport(patient.clinic_id, patient.legacy_id)
        for eraser in erasers_of(Patient):
            eraser(patient, pseudonym)
        for name, value in erased_values(Patient).items():
            setattr(patient, name, value)
        patient.ended_at = patient.ended_at or now
        patient.erased_at, patient.erasure_reason = now, reason
        patient.save()
        for model, path in paths_to_patient().items():
            if model is not Patient:
                _erase_rows(model, path, patient, pseudonym)
        replace_seals(patient, now)
        erase_values("Patient", patient.pk)
        LogEntry.objects.filter(
            content_type=ContentType.objects.get_for_model(Patient), object_id=str(patient.pk)
        ).update(object_repr=patient.pseudonym)
        audit_log.record(
            Act.ERASE,
            by,
            clinic_id=patient.clinic_id,
            about=str(ErasureReason(reason).label),
            now=now,
        )


def _empty_journal() -> None:
    """Empty SQLite's write-ahead log: it holds old pages until they are overwritten.

    It never waits: while others read or write, the pages are left to be overwritten.
    """
    if connection.vendor != "sqlite":
        return
    with connection.cursor() as cursor:
        (timeout_ms,) = cursor.execute("PRAGMA busy_timeout").fetchone()
        try:
            cursor.execute("PRAGMA busy_timeout=0")
            with suppress(DatabaseError):
                cursor.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        finally:
            cursor.execute(f"PRAGMA busy_timeout={timeout_ms:d}")


def _erase_rows(model: type[Model], path: str, patient: Patient, pseudonym: str) -> None:
    """Erase what the policies of a model's fields say, in all rows that lead to a patient."""
    rows = model._base_manager.filter(**{path: patient})
    if any(policy.erasure is Erasure.DELETE for policy in policies_of(model).values()):
        rows.delete()
        return
    if values := erased_values(model):
        rows.update(**values)
    for eraser in erasers_of(model):
        eraser(patient, pseudonym)
