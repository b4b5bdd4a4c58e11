"""Enrollment of patients, their allocation, and withdrawal."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext

from rehab.patients.visits import plan_visit
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import active_consents
from rehab.people.models import Patient, User
from rehab.sessions.formatting import clinic_time
from rehab.studies.agreements import WITHDRAWN, StudyConsent, check_consent
from rehab.studies.allocation.groups_and_strata import Allocated
from rehab.studies.models import Study, StudyState
from rehab.studies.participants import Allocation, Enrollment, Screening, StudyEvent, StudyVisit
from rehab.studies.registration.lifecycle import (
    check_no_open_session,
    check_secret,
    current_version,
    lock,
    note,
    set_blinded,
)
from rehab.studies.screening import check_open, find_unmet
from rehab.training.measures import InvalidSetting


def enroll(
    study: Study,
    patient: Patient,
    levels: Sequence[str],
    *,
    keep_data: bool,
    by: User | None,
    now: datetime,
    met: Collection[str] = (),
    consent: StudyConsent | None = None,
) -> Enrollment:
    """Enroll a patient in a running study: allocate, plan the visits, blind.

    Parameters
    ----------
    study, patient
        The study, and who joins it.
    levels
        The patient's level of each factor of the study.
    keep_data
        Whether sessions still count in the results if the participant withdraws.
    by
        Who enrolls; None for a program.
    now
        The time of the enrollment.
    met
        Those of ``study.criteria`` that ``by`` confirms.
    consent
        The patient's to this study; None for a simulated one.

    Raises
    ------
    InvalidSetting
        For a patient who is not eligible, has not consented to research and to this study, is in
        another study or has an open session; for a study that is not running, is full, or has run
        out of its list; and where ``by`` is an assessor of the study.
    """
    with transaction.atomic():
        lock(study)  # of two enrolled at once, the second is allocated after the first
        patient.lock()
        check_open(study, by)
        _check_may_enter(study, patient)
        check_consent(study, patient, consent, now)
        if unmet := find_unmet(study, patient, met, now):
            raise InvalidSetting(
                gettext("%(patient)s is not eligible: %(criteria)s.")
                % {"patient": patient.nickname, "criteria": "; ".join(unmet)}
            )
        version = current_version(study)
        before = Allocation.everywhere.filter(enrollment__study=study).order_by("pk")
        earlier = [
            Allocated(tuple(past.enrollment.levels), past.group)
            for past in before.select_related("enrollment")
        ]
        group = study.scheme().allocate(check_secret(study), earlier, levels)
        enrollment = Enrollment.everywhere.create(
            clinic_id=study.clinic_id,
            study=study,
            patient=patient,
            version=version,
            code=f"{study.code}-{len(earlier) + 1:03}",
            levels=list(levels),
            keep_data=keep_data,
            consent_version=consent.version.strip() if consent else "",
            consented_on=consent.day if consent else None,
            enrolled_at=now,
            enrolled_by=by,
        )
        Allocation.everywhere.create(enrollment=enrollment, group=group, at=now)
        Screening.everywhere.create(study=study, patient=patient, by=by, at=now)
        note(study, StudyEvent.Kind.ENROLLED, by, now, enrollment=enrollment)
        _plan_visits(enrollment, len(group.split("-")), now)
        set_blinded(patient)
    return enrollment


def _check_may_enter(study: Study, patient: Patient) -> None:
    if study.enrollments.count() >= study.participants:
        message = gettext(
            "The study has all its %(count)s participants. Close it, or revise the number."
        )
        raise InvalidSetting(message % {"count": study.participants})
    names = {"patient": patient.nickname}
    if patient.ended_at is not None:
        raise InvalidSetting(gettext("%(patient)s's program has ended. Reopen it first.") % names)
    other = patient.enrollments.filter(study__state=StudyState.RUNNING).select_related("study")
    if (found := other.first()) is not None:
        message = gettext(
            "%(patient)s is in the study %(study)s already, or has withdrawn from it. One study a "
            "patient: wait until that one is closed."
        )
        raise InvalidSetting(message % (names | {"study": found.study.code}))
    if not patient.simulated and Purpose.RESEARCH not in active_consents(patient):
        message = gettext(
            "%(patient)s has not consented to research. Record the consent on the page “Consent "
            "and data” first."
        )
        raise InvalidSetting(message % names)
    check_no_open_session(study, patient)


def _plan_visits(enrollment: Enrollment, periods: int, now: datetime) -> None:
    """Store the study's visits, and expect the patient on their days."""
    first_day = clinic_time(now, enrollment.study.clinic).date()
    for planned in enrollment.study.visit_plan.plan(periods, first_day):
        StudyVisit.everywhere.create(
            enrollment=enrollment,
            number=planned.number,
            period=planned.period,
            follow_up=planned.follow_up,
            day=planned.day,
        )
        if not enrollment.patient.visits.filter(day=planned.day).exists():
            plan_visit(enrollment.patient, planned.day, None)


def withdraw(
    enrollment: Enrollment,
    by: User | None,
    now: datetime,
    reason: str = "",
    *,
    takes_consent_back: bool = False,
) -> None:
    """Record that a participant leaves the study; sessions count as was agreed at enrollment.

    An open session goes on, as a session of care, until the therapist ends it.

    Parameters
    ----------
    enrollment
        The participant; one who has withdrawn already is left as is.
    by, now
        Who records it (None for a program), and when.
    reason
        Why, as typed; may be empty.
    takes_consent_back
        Whether the consent to the study is withdrawn, and not only its visits ended.
    """
    with transaction.atomic():
        lock(enrollment.study)
        enrollment.refresh_from_db()
        if enrollment.withdrawn_at is not None:
            return
        enrollment.withdrawn_at = now
        enrollment.save(update_fields=["withdrawn_at"])
        note(
            enrollment.study,
            StudyEvent.Kind.WITHDRAWN,
            by,
            now,
            enrollment=enrollment,
            reason=reason,
            about=WITHDRAWN if takes_consent_back else "",
        )
        set_blinded(enrollment.patient)


def withdraw_everywhere(patient: Patient, by: User | None, now: datetime) -> None:
    """Withdraw a patient from every running study, as when consent to research is withdrawn.

    Parameters
    ----------
    patient
        Who leaves.
    by, now
        Who records it (None for a program), and when.
    """
    running = patient.enrollments.filter(withdrawn_at=None, study__state=StudyState.RUNNING)
    for enrollment in running.select_related("study", "patient"):
        withdraw(enrollment, by, now, takes_consent_back=True)
