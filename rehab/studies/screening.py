"""Screening: who was assessed for a study, and who was turned away for which reasons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext

from rehab.people.covariates import months_since
from rehab.people.models import Patient, User
from rehab.sessions.formatting import clinic_time
from rehab.studies.models import Study, StudyMark, StudyState, has_mark
from rehab.studies.participants import Screening
from rehab.training.measures import InvalidSetting


@dataclass(frozen=True, slots=True)
class Assessed:
    """How many were assessed for eligibility, and what became of them (CONSORT 2025, item 22a).

    Attributes
    ----------
    people, not_eligible, declined
        Numbers of people; of whoever was screened again, the last time counts.
    reasons
        How many did not meet each criterion.
    """

    people: int
    not_eligible: int
    declined: int
    reasons: Counter[str]

    @property
    def turned_away(self) -> int:
        """How many were not allocated."""
        return self.not_eligible + self.declined


def check_open(study: Study, by: User | None) -> None:
    """Raise InvalidSetting for a study that takes nobody in, and for an assessor of it."""
    if study.state != StudyState.RUNNING:
        raise InvalidSetting(gettext("Only a running study can enroll patients. Start it first."))
    if by is not None and has_mark(study, by, StudyMark.Task.ASSESSOR):
        raise InvalidSetting(
            gettext(
                "You are an assessor in this study. Ask a colleague who treats to enroll patients."
            )
        )


def check_months(study: Study, patient: Patient, now: datetime) -> list[str]:
    """Return the criterion of the stroke's time where a patient does not meet it.

    Raises InvalidSetting where that is unknown; simulated patients had no stroke.
    """
    least = study.months_since_stroke
    if not least or patient.simulated:
        return []
    months = months_since(patient.stroke_month, clinic_time(now, study.clinic).date())
    if months is None:
        raise InvalidSetting(
            gettext(
                "The study takes people from %(least)d months after the stroke on. Enter the month "
                "of %(patient)s's stroke first."
            )
            % {"least": least, "patient": patient.nickname}
        )
    return [f"≥ {least} months since the stroke"] if months < least else []


def find_unmet(
    study: Study, patient: Patient, met: Collection[str], now: datetime
) -> tuple[str, ...]:
    """Return the criteria that a patient does not meet. ``met``: those that somebody confirmed."""
    return (*check_months(study, patient, now), *(c for c in study.criteria if c not in met))


def turn_away(
    study: Study,
    patient: Patient,
    unmet: Sequence[str],
    *,
    declined: bool,
    by: User | None,
    now: datetime,
) -> Screening:
    """Record that a patient was assessed and does not take part.

    Raises InvalidSetting for a study that is not running, and for an assessor of it.
    """
    with transaction.atomic():
        check_open(study, by)
        return Screening.everywhere.create(
            study=study, patient=patient, unmet=list(unmet), declined=declined, by=by, at=now
        )


def count_assessed(study: Study) -> Assessed:
    """Return the numbers of a study's screening log."""
    last: dict[int, Screening] = {}
    for one in study.screenings.order_by("pk"):
        last[one.patient_id] = one
    enrolled = set(study.enrollments.values_list("patient_id", flat=True))
    away = [one for patient, one in last.items() if patient not in enrolled]
    unfit = [one for one in away if one.unmet]
    return Assessed(
        len(enrolled) + len(away),
        len(unfit),
        len(away) - len(unfit),
        Counter(criterion for one in unfit for criterion in one.unmet),
    )
