"""How long a clinic keeps patients and logs: whose time is over, by the months that it set."""

from __future__ import annotations

from calendar import monthrange
from datetime import datetime

from django.db.models import Exists, Max, OuterRef, QuerySet
from django.db.models.functions import Coalesce, Greatest

from rehab.patients.visits import Visit
from rehab.people.audit import seals
from rehab.people.audit.audit_log import AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.models import Clinic, Patient
from rehab.sessions.formatting import clinic_time


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
    past = patients.annotate(last_here=last).filter(last_here__lt=before)
    return past.exclude(Exists(expected)).order_by("pk")


def delete_old_logs(clinic: Clinic, now: datetime) -> int:
    """Delete entries that are older than a clinic keeps its logs; return how many."""
    before = months_before(now, clinic.log_retention_months)
    logs = (AuditEntry.__name__, HistoryEntry.__name__)
    return sum(seals.cut_before(log, clinic.pk, before, now) for log in logs)


def months_before(moment: datetime, months: int) -> datetime:
    """Return the same day some months earlier, or the last day of a shorter month."""
    year, month = divmod(moment.year * 12 + moment.month - 1 - months, 12)
    year, month = max(year, 1), month + 1
    return moment.replace(year=year, month=month, day=min(moment.day, monthrange(year, month)[1]))
