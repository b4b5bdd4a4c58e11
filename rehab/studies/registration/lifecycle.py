"""A study's way: registered before the first patient, started, changed in versions, closed."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.db import transaction
from django.utils.translation import gettext

from rehab.people.audit import seals
from rehab.people.models import Patient, User
from rehab.sessions.available_tests import fix_tests
from rehab.sessions.models import TrainingSession
from rehab.studies.allocation.scheme import Secret
from rehab.studies.models import Study, StudyMark, StudyState, StudyVersion
from rehab.studies.participants import Allocation, StudyEvent
from rehab.studies.registration.allocation_secret import unseal
from rehab.studies.registration.document import ANALYSIS, describe, digest_of
from rehab.studies.registration.problems import check_plan
from rehab.training.changes import OPEN_STATES
from rehab.training.measures import InvalidSetting

Kind = StudyEvent.Kind
# What a version may change of a study; of its arms, their names and conditions.
REVISABLE = (
    *("title", "question", "participants", "months_since_stroke", "goal_percent"),
    *("inclusion", "exclusion", "follow_up_days", "window_days"),
    *("visits", "days_between", "washout_days", "primary_outcome", "secondary_outcomes"),
    *(*ANALYSIS, "facts"),
)


def lock(study: Study) -> None:
    """Reload a study and lock its row until the end of the transaction."""
    study.refresh_from_db(from_queryset=Study.everywhere.select_for_update(no_key=True))


def note(study: Study, kind: Kind, by: User | None, now: datetime, **details: Any) -> StudyEvent:
    """Store an event of a study, and return it.

    Parameters
    ----------
    study, kind
        The study, and what happened.
    by, now
        Who did it (None for a program), and when.
    details
        Other fields of ``StudyEvent``, such as ``enrollment``, ``reason`` and ``about``.
    """
    return StudyEvent.everywhere.create(study=study, kind=kind, by=by, at=now, **details)


def _expect(study: Study, state: StudyState) -> None:
    if study.state != state:
        message = gettext("This study is %(state)s. Load the page again to see what can be done.")
        raise InvalidSetting(message % {"state": study.get_state_display().lower()})


def _add_version(
    study: Study, by: User | None, now: datetime, reason: str = "", **more: Any
) -> StudyVersion:
    document = describe(study)
    fix_tests(study.clinic_id, [test["slug"] for test in document.get("tests", ())])
    number = study.versions.count() + 1
    return StudyVersion.everywhere.create(
        study=study,
        number=number,
        document=document,
        digest=digest_of(document),
        reason=reason,
        by=by,
        at=now,
        **more,
    )


def check_secret(study: Study) -> Secret:
    """Return what the study allocates by. Raises InvalidSetting where it does not fit the arms."""
    secret = unseal(study.sealed)
    study.scheme().check_secret(secret)
    return secret


def register(study: Study, by: User | None, now: datetime) -> StudyVersion:
    """Fix a study's plan before the first patient, and return its first version.

    Parameters
    ----------
    study
        A draft.
    by, now
        Who registers it (None for a program), and when.

    Raises
    ------
    InvalidSetting
        For a study that is no draft, cannot be run, or could not find one of its outcomes.
    """
    with transaction.atomic():
        lock(study)
        _expect(study, StudyState.DRAFT)
        check_plan(study)
        secret = check_secret(study)
        study.state, study.registered_at = StudyState.REGISTERED, now
        study.commitment = secret.commitment
        version = _add_version(study, by, now)
        study.save(update_fields=["state", "registered_at", "commitment"])
        note(study, Kind.REGISTERED, by, now, about=version.digest)
    return version


def start(study: Study, by: User | None, now: datetime, reason: str = "") -> None:
    """Open a registered study to participants.

    Parameters
    ----------
    study
        A registered study.
    by, now
        Who starts it (None for a program), and when.
    reason
        Why it starts in spite of what was doubted.

    Raises
    ------
    InvalidSetting
        For a study that is not registered, or was started already.
    """
    with transaction.atomic():
        lock(study)
        _expect(study, StudyState.REGISTERED)
        study.state, study.started_at = StudyState.RUNNING, now
        study.save(update_fields=["state", "started_at"])
        note(study, Kind.STARTED, by, now, reason=reason)


def current_version(study: Study) -> StudyVersion:
    """Return the version that sessions are created from. Raises InvalidSetting if it is outdated.

    A clinic edits its measures and protocols: a study does not silently go on with changed ones.
    """
    version = study.versions.last()
    if version is None:
        raise InvalidSetting(gettext("Register the study first."))
    if digest_of(describe(study)) != version.digest:
        raise InvalidSetting(
            gettext(
                "What this study was registered with has been changed since: a protocol, a measure "
                "or an arm. Change it back, or let a lead make a new version on the study's page."
            )
        )
    return version


def revise(
    study: Study, reason: str, by: User | None, now: datetime, *, needs_consent: bool = False
) -> StudyVersion:
    """Store the changes of a study after its registration, and return its new version.

    Parameters
    ----------
    study
        A registered or running study, with changes that are not stored yet.
    reason
        Why it is changed; part of the version.
    by, now
        Who changes it (None for a program), and when.
    needs_consent
        Whether participants have to agree to it before their next visit.

    Raises
    ------
    InvalidSetting
        Without a reason or a change, and for an outcome that could not be found, other groups,
        another ratio or other factors: what was allocated cannot be allocated again.
    """
    with transaction.atomic():
        stored = Study.everywhere.select_for_update(no_key=True).get(pk=study.pk)
        if stored.state not in {StudyState.REGISTERED, StudyState.RUNNING}:
            raise InvalidSetting(gettext("Only a registered or running study has versions."))
        last = stored.versions.latest("number")
        document = describe(study)
        if not reason.strip():
            raise InvalidSetting(
                gettext("Say why the study is changed. The reason is registered as well.")
            )
        if digest_of(document) == last.digest:
            raise InvalidSetting(gettext("Nothing is different from the last version."))
        if document["allocation"] != last.document["allocation"]:
            raise InvalidSetting(
                gettext(
                    "Arms' codes, ratio, factors and allocation stay as they were registered. "
                    "Close this study and plan a new one to change them."
                )
            )
        if stored.started_at and document.get("analysis") != last.document.get("analysis"):
            raise InvalidSetting(
                gettext(
                    "Margin, looks and the planned SD stay as they were when the study started: "
                    "chosen later, they could follow the results."
                )
            )
        check_plan(study)
        study.save(update_fields=REVISABLE)
        version = _add_version(study, by, now, reason.strip(), needs_consent=needs_consent)
        note(study, Kind.REVISED, by, now, about=version.digest, reason=reason.strip())
    return version


def close(study: Study, by: User | None, now: datetime) -> None:
    """Close a study: no one is enrolled or walks any more, and nothing is hidden from here on.

    Parameters
    ----------
    study
        A running study.
    by, now
        Who closes it (None for a program), and when.

    Raises
    ------
    InvalidSetting
        For a study that is not running, and while a participant's session is open.
    """
    with transaction.atomic():
        lock(study)
        _expect(study, StudyState.RUNNING)
        check_no_open_session(study)
        study.state, study.closed_at = StudyState.CLOSED, now
        study.save(update_fields=["state", "closed_at"])
        note(study, Kind.CLOSED, by, now, about=_look_over(study))
        for enrollment in study.enrollments.select_related("patient"):
            set_blinded(enrollment.patient)


def _look_over(study: Study) -> str:
    """Return whether what was recorded of the clinic's studies is as it was sealed.

    A study is closed all the same: what is broken is found by `manage.py doctor`, and mended by
    nobody.
    """
    logs = [model.__name__ for model in (Allocation, StudyEvent, StudyMark)]
    broken = [one for log in logs for one in seals.find_broken_of(log, study.clinic_id)]
    if broken:
        return f"not as sealed, {len(broken)}: {broken[0]}"[:120]
    head = seals.seals_of(StudyEvent.__name__, study.clinic_id).last()
    return f"as sealed: {head.digest}" if head else "nothing sealed yet"


def check_no_open_session(study: Study, patient: Patient | None = None) -> None:
    """Raise InvalidSetting while someone has an open session.

    Parameters
    ----------
    study
        The study, of whose participants none may have one.
    patient
        The only one to be checked, who need not be a participant yet; None for all participants.
    """
    states = [state.value for state in OPEN_STATES]
    of_whom = {"patient__enrollments__study": study} if patient is None else {"patient": patient}
    if TrainingSession.everywhere.filter(state__in=states, **of_whom).exists():
        raise InvalidSetting(gettext("A session is still open. End it first."))


def set_blinded(patient: Patient) -> None:
    """Hide a patient's boards and scores while the patient is in a running study, else show them.

    The patient is saved even if nothing changes: boards follow each save, and then show
    again those who left the study before its end.
    """
    patient.lock()
    blinded = patient.enrollments.filter(
        study__state=StudyState.RUNNING, withdrawn_at=None
    ).exists()
    if patient.erased_at is None:
        patient.blinded = blinded
        patient.save_fields("blinded")
