"""Sessions of a study: created from the arm, once for each planned visit."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext

from rehab.people.models import User
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.sessions.setup.walking_conditions import WalkingConditions
from rehab.stations.models import Station
from rehab.studies.agreements import check_agreed
from rehab.studies.models import StudyState
from rehab.studies.participants import Enrollment, StudyVisit
from rehab.studies.registration.document import find_rule
from rehab.studies.registration.lifecycle import check_no_open_session, current_version
from rehab.training.changes import State
from rehab.training.goal_adaptation import AdaptationMode, GoalAdaptation
from rehab.training.goals import GoalRule
from rehab.training.measures import InvalidSetting
from robot.wire.cue_limits import SEED_MAX


@dataclass(frozen=True, slots=True)
class Place:
    """Where and how a session is walked: parts of a `SessionRequest`."""

    station: Station | None = None
    source: str = ""
    source_args: tuple[str, ...] = ()
    walking: WalkingConditions = field(default_factory=WalkingConditions)
    heart_rate_limit: int | None = None


def next_visit(enrollment: Enrollment) -> StudyVisit | None:
    """Return the first planned visit without a session that counts; None after the last one."""
    latest: dict[int, StudyVisit] = {}
    for visit in enrollment.visits.select_related("session"):
        latest[visit.number] = visit  # ordered by attempt: the last one of each number
    for visit in latest.values():
        if visit.session is None or visit.session.state == State.ABORTED:
            return visit
    return None


def seed_of(study_id: int, visit: int) -> int:
    """Return the seed of phrases and robot's variants: one for all participants at a visit."""
    return (study_id * 1000 + visit) % SEED_MAX


def start_session(
    enrollment: Enrollment,
    place: Place,
    by: User | None,
    now: datetime,
    *,
    chosen_id: str | None = None,
) -> TrainingSession:
    """Create the session of a participant's next visit, with the arm's condition.

    Parameters
    ----------
    enrollment
        The participant.
    place
        Where and how the session is walked.
    by, now
        Who starts it (None for a program), and when.
    chosen_id
        Key of the visit that the page showed as the next one; None without a page.

    Raises
    ------
    InvalidSetting
        For a participant who has withdrawn, walked all visits or has an open session; where another
        visit is next; for a study that is not running or was changed; and for what `create_session`
        refuses, such as an assessor.
    """
    study = enrollment.study
    with transaction.atomic():
        locked = Enrollment.everywhere.select_for_update(no_key=True, of=("self",))
        enrollment.refresh_from_db(from_queryset=locked)
        if study.state != StudyState.RUNNING or enrollment.withdrawn_at is not None:
            raise InvalidSetting(
                gettext("The study is closed, or %(code)s has withdrawn: no session of it starts.")
                % {"code": enrollment.code}
            )
        check_no_open_session(study, enrollment.patient)
        visit = next_visit(enrollment)
        if visit is None:
            raise InvalidSetting(
                gettext("%(code)s has walked all visits of the study.") % {"code": enrollment.code}
            )
        # Two people who start the same visit would begin the next one, too: in another arm, maybe.
        if chosen_id not in (None, str(visit.pk)):
            raise InvalidSetting(
                gettext("Someone else has started that visit. Check the list, then start again.")
            )
        if visit.session is not None:  # it was aborted
            visit = StudyVisit(
                enrollment=enrollment,
                number=visit.number,
                attempt=visit.attempt + 1,
                period=visit.period,
                follow_up=visit.follow_up,
                day=now.date(),
            )
        visit.version = current_version(study)
        check_agreed(enrollment)
        arm = enrollment.allocation.arm_of_period(visit.period)
        visit.session = create_session(
            SessionRequest(
                patient=enrollment.patient,
                valence=arm.valence,
                goal=GoalRule(percent_of_baseline=study.goal_percent),
                adaptation=GoalAdaptation(AdaptationMode.OFF),
                phases=arm.baseline() if visit.follow_up else arm.phases(),
                protocol=arm.protocol,
                measure=arm.measure,
                rule=find_rule(study, arm),
                robot_intensity=arm.robot_intensity,
                schedule=arm.to_rule().condition.schedule,
                seed=seed_of(study.pk, visit.number),
                created_by=by,
                locked=True,
                **{part.name: getattr(place, part.name) for part in fields(place)},
            )
        )
        visit.save()
    return visit.session
