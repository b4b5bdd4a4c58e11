"""Events of steps: the feedback of each, as each audience gets it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from datetime import datetime
from operator import attrgetter
from typing import NamedTuple

from rehab.feedback.translation import translate
from rehab.sessions.events.event import LiveEvent
from rehab.sessions.log import Step
from rehab.sessions.state_messages import (
    Message,
    describe_coaching,
    describe_rates,
    describe_walked,
)
from rehab.training.closeness import CLOSE_WORDS
from rehab.training.controls import Audience
from rehab.training.feedback_bands import Band
from rehab.training.fold import SessionFold
from rehab.training.phases import Phase
from rehab.training.plans import SessionPlan
from rehab.training.schedules import FeedbackSummary, ScheduleKind
from rehab.training.steps import ScoredStep
from rehab.training.valences import Emblem, Valence

StoredStep = Step | ScoredStep
# What the therapist's page gets of a step, under the same names: all that its scoring says.
MONITOR_FIELDS = tuple(field.name for field in fields(ScoredStep) if field.name != "rules_version")
_monitor_values = attrgetter(*MONITOR_FIELDS)


class StepContext(NamedTuple):
    """What a step's feedback follows from, as it was when the step came."""

    phase: Phase
    valence: Valence
    words_shown: bool
    chart_style: str
    answer_count: int  # answers before it
    language: str  # of its words

    @classmethod
    def of(cls, fold: SessionFold) -> StepContext:
        """Return the context of the next step."""
        return cls(
            *(fold.phase, fold.valence, fold.words_shown, fold.chart_style),
            *(fold.delivery.answer_count, fold.valences.language),
        )


def step_event(
    fold: SessionFold,
    context: StepContext,
    step: ScoredStep,
    audiences: Iterable[Audience],
    received_at: datetime | None,
    *,
    live: bool,
) -> LiveEvent:
    """Return the event of a step that was just scored, for these audiences and no other.

    ``received_at`` lets a page find out how long the event took; None when a session is played
    back. ``live`` is False for a step that came too late to be shown as one.
    """
    messages = {
        audience: MESSAGES[audience](fold, context, step, live)
        for audience in audiences
        if audience in MESSAGES
    }
    if received_at is not None:
        at = received_at.timestamp()
        for audience, message in messages.items():
            if message is not None and audience is not Audience.ROBOT:
                message["at"] = at
    return LiveEvent(step.number, messages.__getitem__)


def _for_patient(
    fold: SessionFold, context: StepContext, step: ScoredStep, live: bool
) -> Message | None:
    score, streak, answer = fold.score, fold.feedback.streak, fold.delivery.answer
    shown = patient_step(fold.plan, context, step, score, streak, live=live, answer=answer)
    return None if shown is None else shown | describe_walked(fold)


def _for_monitor(fold: SessionFold, _: StepContext, step: ScoredStep, live: bool) -> Message:
    return {
        "kind": "step",
        "live": live,
        **dict(zip(MONITOR_FIELDS, _monitor_values(step), strict=True)),
        "extra": dict(step.extra),
        "score": fold.score,
        "streak": fold.feedback.streak,
        **describe_rates(fold.feedback),
        **describe_walked(fold),
        **describe_coaching(fold),
    }


def _for_robot(
    _: SessionFold, context: StepContext, step: ScoredStep, live: bool
) -> Message | None:
    return _robot_step(context.phase, step, live=live)


MESSAGES: dict[Audience, Callable[[SessionFold, StepContext, ScoredStep, bool], Message | None]] = {
    Audience.PATIENT: _for_patient,
    Audience.MONITOR: _for_monitor,
    Audience.ROBOT: _for_robot,
}


def patient_step(
    plan: SessionPlan,
    context: StepContext,
    step: StoredStep,
    score: int | None,
    streak: int,
    *,
    live: bool,
    answer: FeedbackSummary | None,
) -> Message | None:
    """Return the patient's message about a step; ``answer`` is None where no feedback is due."""
    if step.side != plan.trained_side:
        return None
    if not context.phase.feedback:
        return {"kind": "calm", "number": step.number}
    if step.performance is None or step.hit is None:
        kind = "missing" if plan.schedule.answers_all else "calm"
        return {"kind": kind, "number": step.number, "live": live}
    if answer is None:
        return {"kind": "calm", "number": step.number}
    if plan.schedule.kind is ScheduleKind.SUMMARY:
        return _summary(plan, context, step, answer, score, streak, live=live)
    valence, band = context.valence, context.valence.band(step.performance)
    if step.close:
        words = plan.close_steps.words
        if context.language != plan.language:
            words = translate(CLOSE_WORDS, context.language)
        band = Band(0, words)
    return {
        "kind": "step",
        "number": step.number,
        "live": live,
        "performance": round(step.performance, 4),
        "hit": step.hit,
        "close": step.close,
        "words": plan.choose_words(band, context.answer_count) if context.words_shown else "",
        "chart": context.chart_style,
        "emblem": Emblem.NEUTRAL if step.close else valence.emblem(step.hit),
        "confetti": band.confetti,
        "points": step.points,
        "score": score,
        "streak": streak if valence.rewards else None,
        # What is measured is shown where it is the feedback itself.
        "shown": None if valence.has_points or step.shown is None else round(step.shown, 2),
        **_goal_beside(context, step),
    }


def _goal_beside(context: StepContext, step: StoredStep) -> Message:
    """Return the goal that the patient reads beside a value, where no points tell."""
    if context.valence.has_points or not context.words_shown or step.goal is None:
        return {}
    return {"goal": round(step.goal, 2)}


def _summary(
    plan: SessionPlan,
    context: StepContext,
    step: StoredStep,
    answer: FeedbackSummary,
    score: int | None,
    streak: int,
    *,
    live: bool,
) -> Message:
    """Return the patient's message about a block of steps: their hits, mean and points."""
    valence, mean = context.valence, answer.mean_performance
    band = valence.band(mean)
    return {
        "kind": "step",
        "number": step.number,
        "live": live,
        "performance": round(mean, 4),
        "hit": mean >= 1,
        "words": plan.choose_words(band, context.answer_count) if context.words_shown else "",
        "chart": context.chart_style,
        "emblem": valence.emblem(mean >= 1),
        "confetti": band.confetti,
        "points": answer.points if valence.has_points else None,
        "score": score,
        "streak": streak if valence.rewards else None,
        "shown": None if valence.has_points else round(answer.mean_shown, 2),
        **_goal_beside(context, step),
        "summary": {"hits": answer.hits, "steps": answer.steps, "close": answer.close},
    }


def _robot_step(phase: Phase, step: ScoredStep, *, live: bool) -> Message | None:
    if not live or not phase.feedback or not phase.robot or step.performance is None:
        return None
    if step.close:
        return None  # a gesture would be a verdict
    return {
        "type": "step",
        "number": step.number,
        "time_s": step.time_s,
        "performance": step.performance,
        # For the original's ROS topics (robot/ros/original_nodes.py).
        "shown": step.shown,
        "goal": step.goal,
    }
