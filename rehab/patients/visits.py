"""Who is expected on which day, and how far today has come."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from enum import StrEnum
from typing import ClassVar

from django.db import models
from django.db.models import Count, QuerySet
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, Patient, User
from rehab.people.scope import ClinicRow, Scope
from rehab.sessions.formatting import at_clinic, midnight_of
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, State

SOON_DAYS = (0, 1, 2, 7)  # from today on: what one tap plans
QUARTER_MIN = 15


class Visit(ClinicRow):
    """A day, and perhaps a time, on which a patient is expected."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="visits", verbose_name=_("clinic")
    )
    patient = models.ForeignKey(
        Patient, on_delete=models.CASCADE, related_name="visits", verbose_name=_("patient")
    )
    day = models.DateField(_("day"))
    at = models.TimeField(_("time"), null=True, blank=True)

    class Meta(ClinicRow.Meta):
        verbose_name = _("visit")
        ordering: ClassVar = ["day", "at", "pk"]
        indexes: ClassVar = [models.Index(fields=["clinic", "day"], name="visit_by_clinic_and_day")]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["patient", "day"], name="visit_once_a_day")
        ]

    def __str__(self) -> str:
        return f"{self.day}"


class Progress(StrEnum):
    """How far somebody has come today, in the order of the list."""

    WALKING = "walking"
    PAUSED = "paused"
    READY = "ready"
    EXPECTED = "expected"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Today:
    """Somebody who is expected today, or was here."""

    patient: Patient
    at: time | None
    progress: Progress
    walked_s: float = 0.0


OPEN_NOW = {
    State.RUNNING: Progress.WALKING,
    State.PAUSED: Progress.PAUSED,
    State.READY: Progress.READY,
}


def plan_visit(patient: Patient, day: date, at: time | None) -> Visit:
    """Expect a patient on a day; a visit of that day gets the new time."""
    visit, _new = Visit.everywhere.update_or_create(
        patient=patient, day=day, defaults={"clinic_id": patient.clinic_id, "at": at}
    )
    return visit


def usual_time(user: User, patient: Patient, now: datetime) -> time | None:
    """Give the time that the next visit may have too: today's, or when the last session began.

    ``now`` is the clinic's clock. Sessions count by the quarter of an hour.
    """
    visits = Visit.objects.visible_to(user).filter(patient=patient)
    planned = visits.filter(day__lte=now.date(), at__isnull=False).order_by("-day").first()
    if planned is not None and planned.day == now.date():
        return planned.at
    sessions = TrainingSession.objects.visible_to(user).filter(patient=patient)
    began = sessions.order_by("-created_at").values_list("created_at", flat=True).first()
    if began is None:
        return planned.at if planned else None
    began = at_clinic(began, patient.clinic)
    minutes = round((began.hour * 60 + began.minute) / QUARTER_MIN) * QUARTER_MIN
    return time(minutes // 60 % 24, minutes % 60)


def read_today(user: User, now: datetime) -> list[Today]:
    """List who is expected at somebody's clinic today or was here: who walks first, who is done
    last, the others by time. ``now`` is the clinic's clock.
    """
    patients = Patient.objects.visible_to(user).filter(ended_at=None)
    patients = patients.annotate(count=Count("sessions", distinct=True))
    visits = Visit.objects.visible_to(user).filter(day=now.date())
    expected = dict(visits.values_list("patient_id", "at"))
    sessions = TrainingSession.objects.visible_to(user).defer("plan")
    here: dict[int, list[TrainingSession]] = {}
    for session in _of_today(sessions, midnight_of(now)):
        here.setdefault(session.patient_id, []).append(session)
    rows = [
        _tell(patient, expected.get(patient.pk), here.get(patient.pk, ()), now)
        for patient in patients.filter(pk__in={*expected, *here})
    ]
    order = list(Progress)
    return sorted(
        rows, key=lambda row: (order.index(row.progress), row.at or time.max, row.patient.nickname)
    )


def _of_today(sessions: QuerySet[TrainingSession], midnight: datetime) -> Iterable[TrainingSession]:
    """Give what is open, and what people have walked since midnight (and a day, at most)."""
    open_now = models.Q(state__in=[state.value for state in OPEN_STATES])
    begun = models.Q(created_at__gte=midnight, created_at__lt=midnight + timedelta(days=1))
    walked = begun & models.Q(active_s__gt=0, simulated=False)
    return sessions.filter(open_now | walked).order_by("created_at")


def _tell(
    patient: Patient, at: time | None, sessions: Iterable[TrainingSession], now: datetime
) -> Today:
    """Tell how far somebody has come; who was not expected came when the first session began."""
    sessions = list(sessions)
    if at is None and sessions:
        at = sessions[0].created_at.astimezone(now.tzinfo).time().replace(second=0, microsecond=0)
    found = [OPEN_NOW[State(row.state)] for row in sessions if State(row.state) in OPEN_STATES]
    done = Progress.DONE if sessions else Progress.EXPECTED
    return Today(patient, at, found[-1] if found else done, sum(row.active_s for row in sessions))
