"""How a patient's time with GARRY ends: the program for now, what leads to the person for good.

An erased patient stays as figures under a new false name: sessions, steps and what boards never
show. Nobody can undo it; backups made before still hold the person (docs/privacy.md).
"""

from __future__ import annotations

from calendar import monthrange
from datetime import datetime

from django.contrib.admin.models import LogEntry
from django.contrib.contenttypes.models import ContentType
from django.db import transaction
from django.db.models import Exists, F, Max, OuterRef, QuerySet
from django.db.models.functions import Coalesce, Greatest
from django.utils.translation import gettext as _

from rehab.people import audit
from rehab.people.audit import Act
from rehab.people.consent import Purpose, withdraw
from rehab.people.erased import keep_away
from rehab.people.history import HistoryEntry, forget_values
from rehab.people.models import Clinic, Ending, Erasing, Patient, User, new_pseudonym
from rehab.sessions.corrections import forget_patient as forget_corrections
from rehab.sessions.log import Remark, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.visits import Visit
from rehab.sessions.words import at_clinic
from rehab.training.changes import OPEN_STATES


class StillOpen(ValueError):
    """A patient whose time cannot end while a session is open."""


def end_program(patient: Patient, because: Ending, now: datetime) -> None:
    """Take a patient off the lists; nothing can be started until it is reopened.

    Raises StillOpen.
    """
    with transaction.atomic():
        _hold_closed(patient)
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


def erase(patient: Patient, because: Erasing, by: User | None, now: datetime) -> None:
    """Erase all that leads to a person, for good and once. Raises StillOpen."""
    with transaction.atomic():
        _hold_closed(patient)
        if patient.erased_at is not None:
            return  # somebody was quicker
        withdraw(patient, Purpose.BOARDS, by, now)
        known_as = patient.pseudonym
        if patient.original_id is not None:
            keep_away(patient.clinic_id, patient.original_id)
        patient.pseudonym = patient.code = new_pseudonym()
        patient.nickname = _("Erased")
        patient.body_mass_kg = patient.original_id = patient.alias = None
        patient.ended_at = patient.ended_at or now
        patient.erased_at, patient.erased_because = now, because
        patient.save()
        sessions = TrainingSession.everywhere.filter(patient=patient)
        sessions.update(source="", runs=[], original=None)  # names of files, rows of the original
        # It still says that the session was imported, but no longer from where.
        sessions.filter(original_id__isnull=False).update(original_id=-1 * F("pk"))
        SessionEvent.everywhere.filter(
            session__patient=patient, kind__in=[remark.value for remark in Remark]
        ).update(data={})
        forget_corrections(patient, known_as)
        Visit.everywhere.filter(patient=patient).delete()
        forget_values("Patient", patient.pk)
        LogEntry.objects.filter(
            content_type=ContentType.objects.get_for_model(Patient), object_id=str(patient.pk)
        ).update(object_repr=patient.pseudonym)
        audit.forget_patient(patient.pk)
        audit.note(
            Act.ERASE, by, clinic=patient.clinic_id, about=str(Erasing(because).label), now=now
        )


def _hold_closed(patient: Patient) -> None:
    """Hold the patient's row. Raises StillOpen where a session could still go on."""
    patient.hold()
    sessions = TrainingSession.everywhere.filter(
        patient=patient, state__in=[state.value for state in OPEN_STATES]
    )
    if sessions.exists():
        said = _("%(patient)s still has an open session. End it first.")
        raise StillOpen(said % {"patient": patient.nickname})


def overdue(clinic: Clinic, now: datetime) -> QuerySet[Patient]:
    """Give the patients whom a clinic has kept for as long as it wants to.

    It counts from the last session, or from the day on which the patient was taken in: sessions
    that were imported are older than that. Whoever is expected again stays.
    """
    patients = Patient.everywhere.filter(clinic=clinic, erased_at=None, simulated=False)
    if clinic.keep_months is None:
        return patients.none()
    last = Greatest(Coalesce(Max("sessions__created_at"), "created_at"), "created_at")
    before = months_before(now, clinic.keep_months)
    today = at_clinic(now, clinic).date()
    expected = Visit.everywhere.filter(patient=OuterRef("pk"), day__gte=today)
    kept = patients.annotate(last_here=last).filter(last_here__lt=before)
    return kept.exclude(Exists(expected)).order_by("pk")


def let_logs_go(clinic: Clinic, now: datetime) -> int:
    """Delete what is older than a clinic keeps its logs; give how many entries."""
    before = months_before(now, clinic.keep_log_months)
    changes, _each = HistoryEntry.everywhere.filter(clinic=clinic, at__lt=before).delete()
    return changes + audit.forget_before(clinic.pk, before)


def months_before(moment: datetime, months: int) -> datetime:
    """Give the same day so many months earlier, or that month's last one where it has no such."""
    year, month = divmod(moment.year * 12 + moment.month - 1 - months, 12)
    year, month = max(year, 1), month + 1
    return moment.replace(year=year, month=month, day=min(moment.day, monthrange(year, month)[1]))
