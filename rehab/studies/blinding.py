"""Who must not know an arm, who may look early, and revealing arms, which is always recorded."""

from __future__ import annotations

from datetime import datetime, timedelta

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
MARKABLE = {
    Task.ASSESSOR: Role.PT,
    Task.INTERIM: Role.RESEARCHER,
    Task.MONITOR: Role.RESEARCHER,
}
ASKED_FOR = timedelta(hours=1)  # so long a second person can confirm that an arm is revealed
ALONE = "alone"


def must_not_know_arms(study: Study, user: User) -> bool:
    """Return whether the arms of a study are hidden from ``user`` now: from its assessors."""
    return study.state != StudyState.CLOSED and has_mark(study, user, Task.ASSESSOR)


def give_mark(study: Study, user: User, task: Task, by: User | None, now: datetime) -> None:
    """Mark an account as an assessor, a monitor, or as one that may see interim results.

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
                    "results or monitor harms. %(name)s has another role."
                )
                % {"name": user}
            )
        if has_mark(study, user, task):
            return
        other = {Task.INTERIM: Task.MONITOR, Task.MONITOR: Task.INTERIM}.get(task)
        if other is not None and has_mark(study, user, other):
            raise InvalidSetting(
                gettext(
                    "Harms by arm would tell which numbered group is which arm. Let one person "
                    "monitor harms and another one look early."
                )
            )
        if task == Task.ASSESSOR:
            check_no_open_session(study)
            treated = study.enrollments.filter(visits__session__created_by=user)
            if treated.exists():
                raise InvalidSetting(
                    gettext(
                        "%(name)s has treated participants and knows their arms. Choose another "
                        "therapist to assess."
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


def find_request(enrollment: Enrollment, now: datetime) -> StudyEvent | None:
    """Return who asked last to reveal a participant's arm, where nobody has confirmed it since.

    Parameters
    ----------
    enrollment, now
        The participant; requests of more than ``ASKED_FOR`` before have lapsed.
    """
    kinds = StudyEvent.Kind
    about_it = (kinds.ASKED, kinds.UNBLINDED, kinds.EMERGENCY)
    last = enrollment.events.filter(kind__in=about_it).order_by("pk").last()
    if last is None or last.kind != kinds.ASKED or now - last.at > ASKED_FOR:
        return None
    return last


def reveal_arms(
    enrollment: Enrollment,
    reason: str,
    *,
    emergency: bool,
    by: User,
    now: datetime,
    second: bool = False,
) -> list[Arm]:
    """Return a participant's arms in the order of the periods; none while a second person is asked.

    Two people reveal an arm: one asks, another one confirms within an hour. In an emergency one
    alone can, which is recorded as such. The study's events and the audit log record who and why.

    Parameters
    ----------
    enrollment
        The participant.
    reason
        Why the arms must be known.
    emergency
        Whether it is an emergency, which is recorded as such.
    by, now
        Who asks, or confirms, and when.
    second
        Whether a second person is asked also in an emergency.

    Raises
    ------
    InvalidSetting
        Without a reason.
    UnblindingRefused
        For an assessor of a running study; the refusal is recorded as well.
    """
    study, kinds = enrollment.study, StudyEvent.Kind
    if not reason.strip():
        raise InvalidSetting(
            gettext("Say why the arm must be known. The study's report shows the reason.")
        )
    if must_not_know_arms(study, by):
        note(study, kinds.REFUSED, by, now, enrollment=enrollment, reason=reason.strip())
        raise UnblindingRefused(
            gettext(
                "You are an assessor in this study, and knowing the arm would invalidate your "
                "measurements. Ask a lead or a treating therapist: they can act at once, even in "
                "an emergency."
            )
        )
    with transaction.atomic():
        lock(study)
        request = find_request(enrollment, now)
        if request is not None and request.by_id == by.pk:
            request = None  # nobody confirms what they asked for
        about = {"enrollment": enrollment, "reason": reason.strip()}
        if request is None and (second or not emergency):
            wish = kinds.EMERGENCY.value if emergency else ""
            note(study, kinds.ASKED, by, now, about=wish, **about)
            return []
        audit_log.record(
            Act.UNBLIND, by, patient_id=enrollment.patient_id, about=enrollment.code, now=now
        )
        is_emergency = emergency or (request is not None and request.about == kinds.EMERGENCY)
        kind = kinds.EMERGENCY if is_emergency else kinds.UNBLINDED
        who = f"asked by {request.by}" if request is not None else ALONE
        note(study, kind, by, now, about=who, **about)
    return arms_of(enrollment)


def arms_of(enrollment: Enrollment) -> list[Arm]:
    """Return a participant's arms in the order of the periods."""
    group = enrollment.allocation.group
    return [enrollment.allocation.arm_of_period(n) for n in range(len(group.split("-")))]


def may_read_arm(enrollment: Enrollment, user: User, now: datetime) -> bool:
    """Return whether an account asked for an arm that another one has revealed within the hour.

    Parameters
    ----------
    enrollment, user, now
        The participant; the account; the time of its request.
    """
    kinds = StudyEvent.Kind
    revealed = enrollment.events.filter(kind__in=(kinds.UNBLINDED, kinds.EMERGENCY)).last()
    if revealed is None or now - revealed.at > ASKED_FOR:
        return False
    asked = enrollment.events.filter(kind=kinds.ASKED, pk__lt=revealed.pk).last()
    return asked is not None and asked.by_id == user.pk and revealed.at - asked.at <= ASKED_FOR
