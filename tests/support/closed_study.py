"""A study that is closed, with a row of each model of studies."""

from __future__ import annotations

from typing import Any

from rehab.people.models import Patient, User
from rehab.sessions.models import TrainingSession
from rehab.studies.models import Arm, Study, StudyMark, StudyVersion
from rehab.studies.participants import (
    Allocation,
    Enrollment,
    Screening,
    StudyEvent,
    StudyVisit,
)
from rehab.studies.power_runs import PowerRun
from rehab.studies.record.adverse_events import AdverseEvent
from tests.support.clock import START
from tests.support.marks import mark

PLAN: dict[str, Any] = {
    **dict.fromkeys(("code", "title", "clinic", "question"), ""),
    "participants": 2,
    "months_since_stroke_at_least": None,
    "design": "parallel",
    "arms": [],
    "allocation": {"method": "blocks", "groups": [], "factors": [], "commitment_sha256": ""},
    "visits": dict.fromkeys(("in_each_period", "days_between", "days_between_periods"), 1),
    "goal_percent_of_baseline": 100,
    "primary_outcome": "hit_rate",
    "secondary_outcomes": [],
    "scoring_rules_version": 1,
}


def close_study(name: str, patient: Patient, session: TrainingSession, by: User) -> Study:
    """Store a study that is closed, so that it hides nothing: with a row of each of its models."""
    study = Study.everywhere.create(
        clinic=patient.clinic,
        code=f"7{patient.clinic_id}"[-8:],
        title=mark(name, Study),
        question=mark(name, Study),
        state="closed",
        participants=2,
        primary_outcome="hit_rate",
        closed_at=START,
    )
    version = StudyVersion.everywhere.create(
        study=study, number=1, document=PLAN, reason=mark(name, StudyVersion)
    )
    for position, valence in enumerate(("positive", "binary")):
        Arm.everywhere.create(
            study=study,
            position=position,
            code="AB"[position],
            name=mark(name, Arm),
            valence=valence,
            measure=session.measure,
            protocol=session.protocol,
        )
    StudyMark.everywhere.create(study=study, user=by, task="assessor")
    enrollment = Enrollment.everywhere.create(
        clinic=patient.clinic,
        study=study,
        patient=patient,
        version=version,
        code=mark(name, Enrollment),
        keep_data=True,
    )
    Allocation.everywhere.create(enrollment=enrollment, group="A")
    Screening.everywhere.create(
        study=study, patient=patient, unmet=[mark(name, Screening)], declined=True
    )
    StudyVisit.everywhere.create(
        enrollment=enrollment,
        number=1,
        period=0,
        day=START.date(),
        session=session,
        version=version,
    )
    StudyEvent.everywhere.create(
        study=study, enrollment=enrollment, kind="enrolled", reason=mark(name, StudyEvent)
    )
    AdverseEvent.everywhere.create(
        enrollment=enrollment, what=mark(name, AdverseEvent), grade=1, relation="none"
    )
    PowerRun.everywhere.create(
        study=study,
        settings={"effects": {"B": 5.0}, "participants": 8, "sd_percent": 10.0}
        | {"kept_percent": 25.0, "dropout_percent": 0.0},
        simulations=1,
        trouble=mark(name, PowerRun),
    )
    return study
