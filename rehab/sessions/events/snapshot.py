"""The snapshot with which a page begins, and past steps as its charts need them."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from rehab.sessions.alarms import OpenAlarms
from rehab.sessions.events.event import presence_for_patient
from rehab.sessions.events.step import StepContext, StoredStep, patient_step
from rehab.sessions.state_messages import (
    Message,
    describe_coaching,
    describe_now,
    describe_phase,
    describe_rates,
    describe_state,
    describe_types,
)
from rehab.training.controls import CONTROLS, Audience
from rehab.training.fold import SessionFold
from rehab.training.plans import SessionPlan
from rehab.training.schedules import FeedbackSummary, ScheduleKind
from rehab.training.steps import InvalidReason

# What a chart needs of a past step.
CHART_FIELDS = ("number", "performance", "hit", "close", "points", "valid", "phase")
PT_CHART_FIELDS = (*CHART_FIELDS, "time_s", "value", "gain", "goal")


def history_entry(
    audience: Audience, plan: SessionPlan, step: StoredStep, with_feedback: Container[int]
) -> Message | None:
    """Return a past step as a chart needs it; None where this audience sees none.

    ``with_feedback``: the latest steps with feedback, where the schedule leaves some without.
    """
    if audience is Audience.PATIENT:
        if not plan.phases[step.phase].feedback:
            return None
        if not (plan.schedule.answers_all or step.number in with_feedback):
            return None
    if step.side != plan.trained_side:
        return None
    fields = CHART_FIELDS if audience is Audience.PATIENT else PT_CHART_FIELDS
    return {name: getattr(step, name) for name in fields}


def snapshot(
    audience: Audience,
    fold: SessionFold,
    about: Message,
    presence: Message,
    recent: Iterable[StoredStep],
    *,
    robot: Message,
    robot_stopped: bool,
    marks: Iterable[Message],
    alarms: OpenAlarms,
    conditions: Mapping[str, float],
) -> Message:
    """Return all that a page of this audience shows, as of the last committed step.

    ``about`` says whose session it is; ``recent`` are the latest steps, oldest first; ``robot`` has
    the robot's latest status and decision; ``marks`` are changes and remarks; ``conditions`` say
    how the patient walks now.
    """
    plan, recent = fold.plan, list(recent)
    entries = (history_entry(audience, plan, step, fold.delivery.reported) for step in recent)
    message: Message = {
        "type": "snapshot",
        "number": fold.last_number,
        **describe_state(fold),
        "completed": fold.completed,
        "about": about,
        **describe_now(fold),
        "unit": plan.measure.unit,
        "span": plan.measure.span,
        "streak": fold.feedback.streak
        if fold.valence.rewards or audience is Audience.MONITOR
        else None,
        **_controls_for(audience, fold),
        "target": {"hit_rate": plan.target.hit_rate, "duration_s": plan.target.duration_s},
        "presence": presence if audience is Audience.MONITOR else presence_for_patient(presence),
        "robot_stopped": robot_stopped,
        "steps": [entry for entry in entries if entry is not None],
    }
    if audience is Audience.PATIENT:
        message |= {"last": _last_step(fold, recent), **alarms.describe_to_patient()}
    if audience is Audience.MONITOR:
        message |= {
            **describe_types(fold),
            **describe_coaching(fold),
            "trained_side": plan.trained_side,
            "higher_is_better": plan.measure.higher_is_better,
            "marks": list(marks),
            "conditions": dict(conditions),
            **alarms.describe(),
            **describe_rates(fold.feedback),
            "obstacle": fold.obstacle,
            "robot": dict(robot),
            "phases": [describe_phase(fold, index) for index in range(len(plan.phases))],
        }
    return message


def _controls_for(audience: Audience, fold: SessionFold) -> Message:
    return {
        control.snapshot_field: control.value_in_force(fold)
        for control in CONTROLS.values()
        if control.snapshot_field and audience in control.snapshot_for
    }


def _last_step(fold: SessionFold, recent: Sequence[StoredStep]) -> Message | None:
    """Return what the patient was last shown of a step; None before the first."""
    plan, context = fold.plan, StepContext.of(fold)
    with_feedback = fold.delivery.reported
    if plan.schedule.kind is ScheduleKind.SUMMARY:
        return None  # of a summary only its last step is stored
    switched_after = fold.valences.switches[-1][0] if fold.valences.switches else 0
    for step in reversed(recent):
        if step.number <= switched_after:
            return None  # it meant something else
        if not (plan.schedule.answers_all or step.number in with_feedback):
            continue
        if step.side == plan.trained_side and InvalidReason.PAUSED not in step.reasons:
            score, streak = fold.score, fold.feedback.streak
            phase, before = plan.phases[step.phase], context.answer_count - 1
            context = context._replace(phase=phase, answer_count=before)
            return patient_step(
                plan, context, step, score, streak, live=False, answer=FeedbackSummary(steps=1)
            )
    return None
