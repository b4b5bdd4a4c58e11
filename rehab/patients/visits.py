"""Visits: who is expected on which day, and each patient's progress today."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from enum import StrEnum
from typing import ClassVar

from django.db import models
from django.db.models import Count
from django.utils.dateparse import parse_date, parse_time
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.field_policy import deleted, personal_fields
from rehab.people.models import Clinic, Patient, User
from rehab.people.scope import ClinicModel, Scope
from rehab.people.simulated import counted
from rehab.sessions.formatting import clinic_time
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day.today import IS_OPEN, begun_today, todays_sessions
from rehab.training.changes import OPEN_STATES, State

QUICK_VISIT_DAYS = (0, 1, 2, 7)  # days from today that one tap plans
MAX_AHEAD = timedelta(days=366)
MAX_WEEKS = 26  # of visits that are planned at once
QUARTER_MIN = 15
LATE_AFTER = timedelta(minutes=10)  # of a visit's time
MISSED_AFTER = timedelta(hours=3)  # who is not here then will hardly come


class InvalidVisitDay(ValueError):
    """A day or time that is no valid visit; the message says what to do."""


class Visit(ClinicModel):
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

    personal = personal_fields({"clinic patient day at": deleted(shown=True, research=False)})

    class Meta(ClinicModel.Meta):
        verbose_name = _("visit")
        ordering: ClassVar = ["day", "at", "pk"]
        indexes: ClassVar = [models.Index(fields=["clinic", "day"], name="visit_by_clinic_and_day")]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["patient", "day"], name="visit_once_a_day")
        ]

    def __str__(self) -> str:
        return f"{self.day}"


class Progress(StrEnum):
    """A patient's progress today."""

    WALKING = "walking"
    PAUSED = "paused"
    READY = "ready"
    EXPECTED = "expected"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class PatientToday:
    """A patient who is expected today or had a session today."""

    patient: Patient
    at: time | None
    progress: Progress
    walked_s: float = 0.0
    is_late: bool = False
    is_missed: bool = False  # late for so long that the patient will hardly come


PROGRESS_OF_OPEN = {
    State.RUNNING: Progress.WALKING,
    State.PAUSED: Progress.PAUSED,
    State.READY: Progress.READY,
}


def plan_visit(patient: Patient, day: date, at: time | None) -> Visit:
    """Store that a patient is expected on a day; a visit of that day gets the new time."""
    visit, _new = Visit.everywhere.update_or_create(
        patient=patient, day=day, defaults={"clinic_id": patient.clinic_id, "at": at}
    )
    return visit


def parse_weeks(given: str) -> int:
    """Return for how many weeks a visit is planned. Raises InvalidVisitDay."""
    if not (given.isascii() and given.isdecimal() and 1 <= int(given[:3]) <= MAX_WEEKS):
        raise InvalidVisitDay(
            gettext("Plan visits for 1 to %(most)s weeks at a time.") % {"most": MAX_WEEKS}
        )
    return int(given)


def parse_day(day: str, at: str, today: date) -> tuple[date, time | None]:
    """Return a day and an optional time. Raises InvalidVisitDay."""
    try:
        chosen, hour = parse_date(day), parse_time(at) if at else None
    except ValueError:
        chosen = hour = None
    if chosen is None or (at and hour is None):
        raise InvalidVisitDay(
            gettext("Choose the day of the visit, and a time such as 10:30 if there is one.")
        )
    if not today <= chosen <= today + MAX_AHEAD:
        raise InvalidVisitDay(gettext("Choose a day between today and a year from now."))
    return chosen, hour


def next_visit(patient_id: int, after: datetime) -> Visit | None:
    """Return the next visit that a patient is expected for after a moment, in the clinic's zone.

    That of a day on which the patient has trained is over, whatever its time.
    """
    planned = Visit.everywhere.filter(patient=patient_id, day__gte=after.date())
    walked = TrainingSession.everywhere.filter(counted(), patient=patient_id, active_s__gt=0)
    if walked.exclude(IS_OPEN).filter(begun_today(after)).exists():
        planned = planned.exclude(day=after.date())
    return planned.exclude(day=after.date(), at__lt=after.time()).order_by("day", "at").first()


def is_late(at: time | None, now: datetime, by: timedelta = LATE_AFTER) -> bool:
    """Return whether who is expected today at a time is late by more than some time.

    Both times are in the clinic's zone.
    """
    return at is not None and datetime.combine(now.date(), at, now.tzinfo) + by < now


def suggested_time(user: User, patient: Patient, now: datetime) -> time | None:
    """Return the time to suggest for the next visit: today's, or when the last session began.

    ``now`` is in the clinic's time zone. Times of sessions are rounded to a quarter of an hour.
    """
    visits = Visit.objects.visible_to(user).filter(patient=patient)
    planned = visits.filter(day__lte=now.date(), at__isnull=False).order_by("-day").first()
    if planned is not None and planned.day == now.date():
        return planned.at
    sessions = TrainingSession.objects.visible_to(user).filter(patient=patient)
    began = sessions.order_by("-created_at").values_list("created_at", flat=True).first()
    if began is None:
        return planned.at if planned else None
    began = clinic_time(began, patient.clinic)
    minutes = round((began.hour * 60 + began.minute) / QUARTER_MIN) * QUARTER_MIN
    return time(minutes // 60 % 24, minutes % 60)


def patients_today(user: User, now: datetime) -> list[PatientToday]:
    """Return who is expected at somebody's clinic today or was here, by time.

    ``now`` is in the clinic's time zone. Ended sessions count if a person walked in them.
    """
    patients = Patient.objects.visible_to(user).filter(ended_at=None)
    patients = patients.annotate(count=Count("sessions", distinct=True))
    visits = Visit.objects.visible_to(user).filter(day=now.date())
    expected = dict(visits.values_list("patient_id", "at"))
    walked = counted() & models.Q(active_s__gt=0)
    sessions = todays_sessions(TrainingSession.objects.visible_to(user), now)
    by_patient: dict[int, list[TrainingSession]] = {}
    for session in sessions.filter(IS_OPEN | walked).order_by("created_at"):
        by_patient.setdefault(session.patient_id, []).append(session)
    rows = [
        _to_row(patient, expected.get(patient.pk), by_patient.get(patient.pk, []), now)
        for patient in patients.filter(pk__in={*expected, *by_patient})
    ]
    return sorted(rows, key=lambda row: (row.at or time.max, row.patient.nickname))


def _to_row(
    patient: Patient, at: time | None, sessions: list[TrainingSession], now: datetime
) -> PatientToday:
    """Return a patient's row; without a planned time it has that of the first session."""
    if at is None and sessions:
        at = sessions[0].created_at.astimezone(now.tzinfo).time().replace(second=0, microsecond=0)
    states = [State(session.state) for session in sessions]
    progress = [PROGRESS_OF_OPEN[state] for state in states if state in OPEN_STATES]
    ended = Progress.DONE if sessions else Progress.EXPECTED
    return PatientToday(
        patient,
        at,
        progress[-1] if progress else ended,
        sum(session.active_s for session in sessions),
        not sessions and is_late(at, now),
        not sessions and is_late(at, now, by=MISSED_AFTER),
    )
