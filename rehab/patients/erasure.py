"""Erasure of what identifies a person, and retention periods."""

from __future__ import annotations

from calendar import monthrange
from datetime import datetime

from django.contrib.admin.models import LogEntry
from django.contrib.contenttypes.models import ContentType
from django.db import transaction
from django.db.models import Exists, F, Max, OuterRef, QuerySet
from django.db.models.functions import Coalesce, Greatest
from django.utils.translation import gettext as _

from rehab.patients.closure import lock_without_open_session
from rehab.patients.family import FamilyLink
from rehab.patients.visits import Visit
from rehab.people.audit import audit_log, seals
from rehab.people.audit.audit_log import Act
from rehab.people.audit.history import erase_values
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.consent.tombstones import block_reimport
from rehab.people.models import Clinic, ErasureReason, Patient, User, generate_pseudonym
from rehab.sessions.corrections import anonymize_corrections
from rehab.sessions.formatting import clinic_time
from rehab.sessions.log import Remark, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.training.changes import ChangeKind


def erase(patient: Patient, reason: ErasureReason, by: User | None, now: datetime) -> None:
    """Erase everything that identifies a person, permanently. Raises SessionStillOpen."""
    with transaction.atomic():
        lock_without_open_session(patient)
        if patient.erased_at is not None:
            return  # somebody else has erased it meanwhile
        withdraw_consent(patient, Purpose.BOARDS, by, now)
        old_pseudonym = patient.pseudonym
        if patient.legacy_id is not None:
            block_reimport(patient.clinic_id, patient.legacy_id)
        patient.pseudonym = patient.code = generate_pseudonym()
        patient.nickname = _("Erased")
        patient.body_mass_kg = patient.legacy_id = patient.alias = None
        patient.birth_year = patient.stroke_month = None
        patient.severity = ""
        patient.ended_at = patient.ended_at or now
        patient.erased_at, patient.erasure_reason = now, reason
        patient.save()
        sessions = TrainingSession.everywhere.filter(patient=patient)
        # Sources may be files that are named after a person.
        sessions.update(source="", source_args=[], legacy_row=None)
        # The session is still marked as imported, but its original cannot be found.
        sessions.filter(legacy_id__isnull=False).update(legacy_id=-1 * F("pk"))
        SessionEvent.everywhere.filter(
            session__patient=patient, kind__in=[remark.value for remark in Remark]
        ).update(data={})
        _erase_typed_words(patient)
        anonymize_corrections(patient, old_pseudonym)
        Visit.everywhere.filter(patient=patient).delete()
        FamilyLink.everywhere.filter(patient=patient).delete()
        erase_values("Patient", patient.pk)
        LogEntry.objects.filter(
            content_type=ContentType.objects.get_for_model(Patient), object_id=str(patient.pk)
        ).update(object_repr=patient.pseudonym)
        audit_log.anonymize_patient(patient.pk)
        audit_log.record(
            Act.ERASE,
            by,
            clinic_id=patient.clinic_id,
            about=str(ErasureReason(reason).label),
            now=now,
        )


def _erase_typed_words(patient: Patient) -> None:
    """Empty the words that were typed for a patient's sessions: they may name anybody."""
    edits = SessionEvent.everywhere.filter(
        session__patient=patient, kind=ChangeKind.FEEDBACK_TEXT.value
    )
    emptied = list(edits)
    for edit in emptied:
        for band in edit.data.get("value", {}).get("bands", ()):
            band["words"] = ""
    edits.bulk_update(emptied, ["data"])


def patients_past_retention(clinic: Clinic, now: datetime) -> QuerySet[Patient]:
    """Return the patients whose retention period has passed.

    It begins with the last session, but not before the patient was added, since imported sessions
    are older. Patients with a planned visit are not among them.
    """
    patients = Patient.everywhere.filter(clinic=clinic, erased_at=None, simulated=False)
    if clinic.retention_months is None:
        return patients.none()
    last = Greatest(Coalesce(Max("sessions__created_at"), "created_at"), "created_at")
    before = months_before(now, clinic.retention_months)
    today = clinic_time(now, clinic).date()
    expected = Visit.everywhere.filter(patient=OuterRef("pk"), day__gte=today)
    kept = patients.annotate(last_here=last).filter(last_here__lt=before)
    return kept.exclude(Exists(expected)).order_by("pk")


def delete_old_logs(clinic: Clinic, now: datetime) -> int:
    """Delete entries that are older than a clinic keeps its logs; return how many."""
    before = months_before(now, clinic.log_retention_months)
    return sum(seals.cut_before(log, clinic.pk, before, now) for log in seals.LOGS)


def months_before(moment: datetime, months: int) -> datetime:
    """Return the same day some months earlier, or the last day of a shorter month."""
    year, month = divmod(moment.year * 12 + moment.month - 1 - months, 12)
    year, month = max(year, 1), month + 1
    return moment.replace(year=year, month=month, day=min(moment.day, monthrange(year, month)[1]))
