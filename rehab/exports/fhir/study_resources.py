"""Studies as FHIR resources: the study, who takes part, adverse events; and patients' goals.

Source: HL7 FHIR 4.0.1 and 4.3.0. No arm is told before a study is closed; who sees an adverse
event is said by its scope, as on GARRY's pages.
"""

from __future__ import annotations

from collections.abc import Iterator

from rehab.exports.fhir.resources import SYSTEM, Names, Resource, format_moment, set_goal
from rehab.people.models import Patient, User
from rehab.sessions.models import TrainingSession
from rehab.studies.models import Study, StudyState
from rehab.studies.participants import Enrollment
from rehab.studies.record.adverse_events import AdverseEvent, Grade, arm_of
from rehab.training.changes import ENDED_STATES

TERMS = "http://terminology.hl7.org/CodeSystem"
STATUS = {
    StudyState.REGISTERED: "approved",
    StudyState.RUNNING: "active",
    StudyState.CLOSED: "completed",
}
SEVERITY = {Grade.MILD: "mild", Grade.MODERATE: "moderate"}  # all above: severe


def make_patient(_user: User, patient: Patient, names: Names) -> Iterator[tuple[str, Resource]]:
    """Yield a patient."""
    yield names.patient(patient)


def make_study(_user: User, study: Study, names: Names) -> Iterator[tuple[str, Resource]]:
    """Yield a study that is registered."""
    period = {"start": study.started_at, "end": study.closed_at}
    known = {name: format_moment(at + names.shift) for name, at in period.items() if at}
    resource: Resource = {
        "resourceType": "ResearchStudy",
        "identifier": [{"system": f"{SYSTEM}:study", "value": study.code}],
        "title": study.title,
        "status": STATUS[StudyState(study.state)],
        **({"period": known} if known else {}),
        **({"description": study.question} if study.question else {}),
    }
    if study.state == StudyState.CLOSED:
        resource["arm"] = [{"name": arm.code, "description": arm.name} for arm in study.arms.all()]
    yield names.address("ResearchStudy", "study", study.pk), resource


def make_subject(
    _user: User, enrollment: Enrollment, names: Names
) -> Iterator[tuple[str, Resource]]:
    """Yield a patient's part in a study; the arm of a closed one."""
    study, left = enrollment.study, enrollment.withdrawn_at
    is_closed = study.state == StudyState.CLOSED
    ended = left or study.closed_at
    resource: Resource = {
        "resourceType": "ResearchSubject",
        "identifier": [{"system": f"{SYSTEM}:participant", "value": enrollment.code}],
        "status": "withdrawn" if left else "off-study" if is_closed else "on-study",
        "period": {
            "start": format_moment(enrollment.enrolled_at + names.shift),
            **({"end": format_moment(ended + names.shift)} if ended else {}),
        },
        "study": {"reference": names.address("ResearchStudy", "study", study.pk)},
        "individual": {"reference": names.patient(enrollment.patient)[0]},
    }
    if is_closed:
        resource["assignedArm"] = enrollment.allocation.group
    yield names.address("ResearchSubject", "subject", enrollment.pk), resource


def make_event(_user: User, event: AdverseEvent, names: Names) -> Iterator[tuple[str, Resource]]:
    """Yield an adverse event; with the arm once the study is closed."""
    study = event.enrollment.study
    severity = SEVERITY.get(Grade(event.grade), "severe")
    serious = "serious" if event.is_serious else "non-serious"
    what = event.what or event.get_grade_display()
    is_closed = study.state == StudyState.CLOSED
    resource: Resource = {
        "resourceType": "AdverseEvent",
        "actuality": "actual",
        "event": {"text": f"{what} ({arm_of(event)})" if is_closed else what},
        "subject": {"reference": names.patient(event.enrollment.patient)[0]},
        "date": format_moment(event.at + names.shift),
        "seriousness": _code("adverse-event-seriousness", serious),
        "severity": _code("adverse-event-severity", severity),
        "study": [{"reference": names.address("ResearchStudy", "study", study.pk)}],
    }
    if event.grade == Grade.DEATH:
        resource["outcome"] = _code("adverse-event-outcome", "fatal")
    yield names.address("AdverseEvent", "event", event.pk), resource


def make_goals(user: User, patient: Patient, names: Names) -> Iterator[tuple[str, Resource]]:
    """Yield a patient's own goal, and those set in ended sessions that a user may see."""
    if patient.own_goal:
        yield (
            names.address("Goal", "goal", patient.pk),
            {
                "resourceType": "Goal",
                "lifecycleStatus": "active" if patient.ended_at is None else "completed",
                "description": {"text": patient.own_goal},
                "subject": {"reference": names.patient(patient)[0]},
            },
        )
    ended = [state.value for state in ENDED_STATES]
    sessions = TrainingSession.objects.visible_to(user).filter(
        patient=patient, state__in=ended, excluded=False
    )
    for session in sessions.select_related("patient", "measure").order_by("pk"):
        yield from set_goal(session, names)


def _code(system: str, code: str) -> Resource:
    return {"coding": [{"system": f"{TERMS}/{system}", "code": code}]}
