"""The document of a study that is registered: all that decides what participants walk.

What was added to GARRY later is in it only where a study uses it, so that the digest of studies
registered before does not change.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from hashlib import sha256
from typing import Any

from rehab.feedback.models import FeedbackType
from rehab.questionnaires.instrument import Instrument
from rehab.sessions.available_tests import own_tests
from rehab.sessions.questionnaires import find_instrument
from rehab.studies.analysis.clinical_outcomes import SLUGS, slug_of
from rehab.studies.models import Arm, Study
from rehab.studies.registration.size import read_assumed
from rehab.training.goals import GoalRule
from rehab.training.measures import Measure
from rehab.training.phases import Phase
from rehab.training.plans import SessionPlan
from rehab.training.scoring import RULES_VERSION
from rehab.training.steps import Side
from rehab.training.valences import find_valence

# What a document leaves out: A2 as it was when the first studies were registered, whatever was
# corrected since.
FIRST_A2 = Measure(
    slug="a2",
    name="ankle push-off power A2",
    unit="W/kg",
    value_min=0.0,
    value_max=20.0,
    goal_min=0.0,
    goal_max=15.0,
    first_goal=3.9,
)
ANALYSIS = ("margin", "spending", "planned_sd", "assumed")
USUAL_PHASE = {"goal_percent": None, "robot": True, "rest_s": None}


def describe(study: Study) -> dict[str, Any]:
    """Return the study as it is registered. Raises InvalidSetting for one that could not be run."""
    scheme = study.scheme()
    plan = study.visit_plan
    document: dict[str, Any] = {
        "code": study.code,
        "title": study.title,
        "clinic": study.clinic.name,
        "question": study.question,
        "participants": study.participants,
        "months_since_stroke_at_least": study.months_since_stroke,
        "design": "crossover" if study.crossover else "parallel",
        "arms": [describe_arm(study, arm) for arm in study.arms.select_related("measure")],
        "allocation": scheme.to_json() | {"commitment_sha256": study.commitment},
        "visits": {
            "in_each_period": plan.visits,
            "days_between": plan.days_between,
            "days_between_periods": plan.washout_days,
        },
        "goal_percent_of_baseline": study.goal_percent,
        "primary_outcome": study.primary_outcome,
        "secondary_outcomes": study.secondary_outcomes,
        "scoring_rules_version": RULES_VERSION,
    }
    if plan.follow_up_days is not None:
        document["visits"]["days_to_follow_up"] = plan.follow_up_days
        for arm in study.arms.all():
            arm.baseline()  # raises InvalidSetting where a follow-up could not be walked
    if study.window_days is not None:
        document["visits"]["window_days"] = study.window_days
    named = {study.primary_outcome, *study.secondary_outcomes}
    tests = [
        test.to_json()
        for slug, test in own_tests(study.clinic_id).items()
        if any(slug_of(slug, window) in named for window in SLUGS)
    ]
    document |= {"tests": tests} if tests else {}
    planned = {name: getattr(study, name) for name in ANALYSIS if getattr(study, name)}
    if read_assumed(planned) is None:
        planned.pop("assumed", None)
    document |= {"analysis": planned} if planned else {}
    document |= {"facts": study.facts} if study.facts else {}
    criteria = {"inclusion": study.inclusion_criteria, "exclusion": study.exclusion_criteria}
    document |= {name: asked for name, asked in criteria.items() if asked}
    stored: dict[str, Any] = json.loads(json.dumps(document))  # so that tuples are lists
    return stored


def find_rule(study: Study, arm: Arm) -> Measure:
    """Return how an arm's measure is scored.

    Measures that all clinics share follow corrections in code; a study that is registered stays
    with what it was registered with, also in later versions.
    """
    version = None if study.is_draft or arm.measure.clinic_id else study.versions.last()
    for one in version.document.get("arms", ()) if version is not None else ():
        if (one["code"], one["measure"]) == (arm.code, arm.measure.slug):
            return Measure(**one["measure_rule"]) if "measure_rule" in one else FIRST_A2
    return arm.measure.to_rule()


def digest_of(document: dict[str, Any]) -> str:
    """Return the SHA-256 of a document, as JSON with sorted keys and without blanks."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return sha256(text.encode()).hexdigest()


def describe_arm(study: Study, arm: Arm) -> dict[str, Any]:
    """Return an arm as it is registered. Raises InvalidSetting for one that cannot be walked."""
    phases, schedule = arm.phases(), arm.to_rule().condition.schedule
    measure, protocol = find_rule(study, arm), arm.protocol
    assert protocol is not None  # noqa: S101 - phases() refuses an arm without one
    SessionPlan(  # raises InvalidSetting for one that could not be walked
        measure=measure,
        valence=find_valence(arm.valence),
        phases=phases,
        trained_side=Side.LEFT,
        goal=GoalRule(percent_of_baseline=study.goal_percent),
        schedule=schedule,
    )
    described: dict[str, Any] = {
        "code": arm.code,
        "name": arm.name,
        "weight": arm.weight,
        "feedback_type": arm.valence,
        "gain": arm.gain,
        "robot_intensity": arm.robot_intensity,
        "measure": arm.measure.slug,
        "protocol": protocol.name,
        "phases": [_describe_phase(phase) for phase in phases],
    }
    if measure != FIRST_A2:
        described["measure_rule"] = asdict(measure)
    if not schedule.answers_all:
        described["schedule"] = asdict(schedule)
    if protocol.close_percent is not None:
        described["close_percent"] = protocol.close_percent
    asked = [find_instrument(slug, study.clinic_id, "en") for slug in protocol.questionnaires]
    if asked:
        described["questionnaires"] = [_describe_questionnaire(one) for one in asked]
    edited = FeedbackType.everywhere.filter(clinic=study.clinic_id, slug=arm.valence).first()
    if edited is not None:
        described["feedback"] = _describe_feedback(edited)
    return described


def _describe_phase(phase: Phase) -> dict[str, Any]:
    described = asdict(phase)
    return {
        name: described[name] for name in described if described[name] != USUAL_PHASE.get(name, ...)
    }


def _describe_questionnaire(instrument: Instrument) -> dict[str, Any]:
    return {"title": instrument.title, "items": [item.text for item in instrument.items]}


def _describe_feedback(edited: FeedbackType) -> dict[str, Any]:
    """Return what the clinic made of a feedback type, with its words in all languages."""
    fields = ("hit_points", "miss_points", "cue_above", "cue_below")
    return {name: getattr(edited, name) for name in fields} | {
        "bands": list(
            edited.bands.order_by("from_percent").values("from_percent", "words", "confetti")
        )
    }
