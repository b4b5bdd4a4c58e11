"""Who must not know an arm, who may look early, and revealing arms, which is always recorded."""

from __future__ import annotations

from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.studies.models import Arm, Study, StudyMark, StudyState, has_mark
from rehab.studies.participants import Enrollment, StudyEvent
from rehab.studies.registration.lifecycle import check_no_open_session, lock, note
from rehab.training.measures import InvalidSetting

Task = StudyMark.Task
# Who may have which mark. A lead steers the study and reads the audit log, so a lead cannot assess.
MARKABLE = {Task.ASSESSOR: Role.PT, Task.INTERIM: Role.RESEARCHER}


def give_mark(study: Study, user: User, task: Task, by: User | None, now: datetime) -> None:
    """Mark an account as an assessor, or as one that may see interim results.

    Parameters
    ----------
    study
        The study.
    user, task
        The account, and its mark.
    by, now
        Who gives it (None for a program), and when.

    Raises
    ------
    InvalidSetting
        For a role that cannot have the mark; as assessor, also for an account that has set up
        sessions of the study, and while a participant's session is open.
    """
    with transaction.atomic():
        lock(study)
        if user.clinic_id != study.clinic_id or user.role != MARKABLE[task]:
            raise InvalidSetting(
                gettext(
                    "Only therapists can be assessors, and only researchers can see interim "
                    "results. %(name)s has another role."
                )
                % {"name": user}
            )
        if has_mark(study, user, task):
            return
        if task == Task.ASSESSOR:
            check_no_open_session(study)
            treated = study.enrollments.filter(visits__session__created_by=user)
            if treated.exists():
                raise InvalidSetting(
                    gettext(
                        "%(name)s has treated participants and knows their arms. Choose somebody "
                        "else to assess."
                    )
                    % {"name": user}
                )
        StudyMark.everywhere.create(study=study, user=user, task=task, by=by, at=now)
        note(study, StudyEvent.Kind.MARKED, by, now, about=f"{task.value}: {user}")


def take_mark(mark: StudyMark, by: User | None, now: datetime) -> None:
    """End a mark. A former assessor may see sessions from here on; the events show since when.

    Parameters
    ----------
    mark
        The mark; one that has ended already is left as is.
    by, now
        Who ends it (None for a program), and when.
    """
    with transaction.atomic():
        lock(mark.study)
        mark.refresh_from_db()
        if mark.ended_at is None:
            note(mark.study, StudyEvent.Kind.UNMARKED, by, now, about=f"{mark.task}: {mark.user}")
            mark.ended_at = now
            mark.save(update_fields=["ended_at"])


class UnblindingRefused(InvalidSetting):
    """An account that must not know an arm asked for it."""


def reveal_arms(
    enrollment: Enrollment, reason: str, *, emergency: bool, by: User, now: datetime
) -> list[Arm]:
    """Return a participant's arms in the order of the periods.

    The study's events and the audit log record who asked and why.

    Parameters
    ----------
    enrollment
        The participant.
    reason
        Why the arms must be known.
    emergency
        Whether it is an emergency, which is recorded as such.
    by, now
        Who asks, and when.

    Raises
    ------
    InvalidSetting
        Without a reason.
    UnblindingRefused
        For an assessor of a running study; the refusal is recorded as well.
    """
    study = enrollment.study
    if not reason.strip():
        raise InvalidSetting(
            gettext("Say why the arm must be known. The study's report shows the reason.")
        )
    if study.state == StudyState.RUNNING and has_mark(study, by, Task.ASSESSOR):
        note(study, StudyEvent.Kind.REFUSED, by, now, enrollment=enrollment, reason=reason.strip())
        raise UnblindingRefused(
            gettext(
                "You are an assessor in this study, and knowing the arm would invalidate your "
                "measurements. Ask a lead or a treating therapist: they can act at once, even in "
                "an emergency."
            )
        )
    audit_log.record(
        Act.UNBLIND, by, patient_id=enrollment.patient_id, about=enrollment.code, now=now
    )
    kind = StudyEvent.Kind.EMERGENCY if emergency else StudyEvent.Kind.UNBLINDED
    note(study, kind, by, now, enrollment=enrollment, reason=reason.strip())
    group = enrollment.allocation.group
    return [enrollment.allocation.arm_of_period(n) for n in range(len(group.split("-")))]
