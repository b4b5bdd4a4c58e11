"""What happens in a live session, as each kind of viewer hears it. Nothing here does anything."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from typing import Any, Protocol

from rehab.training.changes import ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.phases import Phase, find_phase_kind
from rehab.training.plans import SessionPlan
from rehab.training.steps import Reason, ScoredStep

Message = dict[str, Any]


class Audience(StrEnum):
    """Who listens."""

    PATIENT = "patient"
    MONITOR = "monitor"
    ROBOT = "robot"


_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False).encode


def to_text(message: Message) -> str:
    """Give a message as a frame's text."""
    return _encode(message)


class LiveEvent:
    """One thing that happened. Its text for an audience is made once, when first asked for."""

    __slots__ = ("_build", "_texts", "number")

    def __init__(self, number: int, build: Callable[[Audience], Message | None]) -> None:
        self.number = number  # the last step at that moment
        self._build = build
        self._texts: dict[Audience, str | None] = {}

    def text(self, audience: Audience) -> str | None:
        """Give what this audience hears; None for nothing."""
        if audience not in self._texts:
            message = self._build(audience)
            self._texts[audience] = None if message is None else to_text(message)
        return self._texts[audience]


class StoredStep(Protocol):
    """What a scored step and its row in the log have in common."""

    @property
    def number(self) -> int: ...
    @property
    def performance(self) -> float | None: ...
    @property
    def hit(self) -> bool | None: ...
    @property
    def points(self) -> int | None: ...
    @property
    def shown(self) -> float | None: ...
    @property
    def valid(self) -> bool: ...
    @property
    def phase(self) -> int: ...
    @property
    def side(self) -> str: ...
    @property
    def reasons(self) -> Sequence[str]: ...


def step_event(fold: SessionFold, phase: Phase, step: ScoredStep, *, live: bool) -> LiveEvent:
    """Give the event of a step that was just scored in this phase.

    ``live`` is False for a step that came too late to be shown as one.
    """
    tally, score, plan, walked = fold.feedback, fold.score, fold.plan, describe_walked(fold)
    streak, hits, judged = tally.streak, tally.hits, tally.judged

    def build(audience: Audience) -> Message | None:
        match audience:
            case Audience.PATIENT:
                shown = _patient_step(plan, phase, step, score, streak, live=live)
                return None if shown is None else shown | walked
            case Audience.MONITOR:
                rate = {
                    "hit_rate": hits / judged if judged else None,
                    "hits": hits,
                    "judged": judged,
                }
                totals = {"score": score, "streak": streak, **rate, **walked}
                return _monitor_step(step, live=live) | totals
            case Audience.ROBOT:
                return _robot_step(plan, phase, step, live=live)

    return LiveEvent(step.number, build)


def describe_walked(fold: SessionFold) -> Message:
    """Give how far the session and its phase have come."""
    return {
        "active_s": round(fold.active_s, 2),
        "phase_s": round(fold.phase_s, 2),
        "phase_strides": fold.phase_strides,
    }


def _patient_step(
    plan: SessionPlan,
    phase: Phase,
    step: StoredStep,
    score: int | None,
    streak: int,
    *,
    live: bool,
) -> Message | None:
    if step.side != plan.trained_side:
        return None
    if not phase.feedback:
        return {"kind": "calm", "number": step.number}
    if step.performance is None or step.hit is None:
        return {"kind": "missing", "number": step.number, "live": live}
    valence, band = plan.valence, plan.valence.band(step.performance)
    return {
        "kind": "step",
        "number": step.number,
        "live": live,
        "performance": round(step.performance, 4),
        "hit": step.hit,
        "words": band.words,
        "emblem": valence.emblem(step.hit),
        "confetti": band.confetti,
        "points": step.points,
        "score": score,
        "streak": streak if valence.rewards else None,
        # What is measured is shown where it is the feedback itself.
        "shown": None if valence.has_points or step.shown is None else round(step.shown, 2),
    }


def _monitor_step(step: ScoredStep, *, live: bool) -> Message:
    return {
        "kind": "step",
        "number": step.number,
        "live": live,
        "time_s": step.time_s,
        "side": step.side,
        "value": step.value,
        "gain": step.gain,
        "shown": step.shown,
        "goal": step.goal,
        "performance": step.performance,
        "hit": step.hit,
        "points": step.points,
        "valid": step.valid,
        "reasons": step.reasons,
        "phase": step.phase,
        "extra": dict(step.extra),
    }


def _robot_step(plan: SessionPlan, phase: Phase, step: ScoredStep, *, live: bool) -> Message | None:
    if not live or not phase.feedback or step.performance is None:
        return None
    return {
        "type": "step",
        "number": step.number,
        "time_s": step.time_s,
        "performance": step.performance,
        # For the original's ROS topics (robot/original_topics.py).
        "shown": step.shown,
        "goal": step.goal,
    }


def describe_phase(plan: SessionPlan, index: int) -> Message:
    """Give a phase as pages show it."""
    phase = plan.phases[index]
    return {
        "index": index,
        "count": len(plan.phases),
        "kind": phase.kind,
        "name": phase.name,
        "feedback": phase.feedback,
        "calm_words": "" if phase.feedback else find_phase_kind(phase.kind).calm_words,
        "theme": plan.valence.slug if phase.feedback else "calm",
        "strides": phase.strides,
        "seconds": phase.seconds,
    }


def describe_cue(fold: SessionFold) -> Message:
    """Give the robot's order for this session."""
    cue = fold.plan.valence.cue
    return {
        "above": cue.above,
        "below": cue.below,
        "threshold": fold.activation_threshold,
        "window_s": 5.0,
        "rest_s": 5.0,
        "intensity": fold.robot_intensity,
        "gestures": list(fold.plan.gestures),
    }


def state_event(fold: SessionFold) -> LiveEvent:
    """Give the event that a session started, paused, went on or ended."""
    state = fold.state.value
    return _same_for_all(fold, {"kind": "state", "state": state}, {"type": "state", "state": state})


def phase_event(fold: SessionFold) -> LiveEvent:
    """Give the event that a phase began."""
    phase = {"kind": "phase", "phase": describe_phase(fold.plan, fold.phase_index)}
    phase |= describe_walked(fold)
    monitor = phase | {"goal": fold.goal, "gain": fold.gain, "obstacle": fold.obstacle}
    return _to_each(fold, patient=phase, monitor=monitor)


def change_event(fold: SessionFold, kind: ChangeKind) -> LiveEvent:
    """Give the event of any change that a person made."""
    match kind:
        case ChangeKind.PHASE:
            return phase_event(fold)
        case ChangeKind.GOAL:
            return _to_each(fold, monitor={"kind": "goal", "goal": fold.goal})
        case ChangeKind.GAIN:
            return _to_each(fold, monitor={"kind": "gain", "gain": fold.gain})
        case ChangeKind.ACTIVATION_THRESHOLD:
            threshold = {"kind": "activation_threshold", "value": fold.activation_threshold}
            return _to_each(fold, monitor=threshold, robot=_cue(fold))
        case ChangeKind.ROBOT_INTENSITY:
            intensity = {"kind": "robot_intensity", "value": fold.robot_intensity}
            return _to_each(fold, monitor=intensity, robot=_cue(fold))
    return state_event(fold)


def _cue(fold: SessionFold) -> Message:
    return {"type": "cue", "cue": describe_cue(fold)}


def presence_event(fold: SessionFold, presence: Message) -> LiveEvent:
    """Give the event that a source, tablet or robot came or went."""
    event = {"kind": "presence", "presence": presence}
    near = {"kind": "presence", "presence": _near(presence)}
    return _to_each(fold, patient=near, monitor=event)


def _near(presence: Message) -> Message:
    """Give what a patient is told of who is there."""
    return {"source": presence["source"], "robot": presence["robot"]}


def report_event(fold: SessionFold, report: Message) -> LiveEvent:
    """Give the event that the robot reported something."""
    return _to_each(fold, monitor={"kind": "robot", "report": report})


def robot_stopped_event(fold: SessionFold, stopped: bool) -> LiveEvent:
    """Give the event that someone stopped the robot, or that a person armed it again."""
    event = {"kind": "robot_stopped", "stopped": stopped}
    return _to_each(fold, patient=event, monitor=event)


def remark_event(fold: SessionFold, what: str, value: float | None) -> LiveEvent:
    """Give the event that a PT noted something."""
    event = {"kind": "remark", "what": what, "value": value, "number": fold.last_number}
    return _to_each(fold, monitor=event)


def source_goal_event(fold: SessionFold, goal: float) -> LiveEvent:
    """Give the event that a source believes in another goal than the PT's."""
    return _to_each(fold, monitor={"kind": "source_goal", "goal": goal})


def _same_for_all(fold: SessionFold, page: Message, robot: Message) -> LiveEvent:
    return _to_each(fold, patient=page, monitor=page, robot=robot)


def _to_each(fold: SessionFold, **messages: Message) -> LiveEvent:
    return LiveEvent(fold.last_number, lambda audience: messages.get(audience.value))


def history_entry(audience: Audience, plan: SessionPlan, step: StoredStep) -> Message | None:
    """Give a past step as a chart needs it; None where this audience sees none."""
    if audience is Audience.PATIENT and not plan.phases[step.phase].feedback:
        return None
    if step.side != plan.trained_side:
        return None
    return {
        "number": step.number,
        "performance": step.performance,
        "hit": step.hit,
        "points": step.points,
        "valid": step.valid,
        "phase": step.phase,
    }


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
) -> Message:
    """Give all that a page of this audience shows, as of the last committed step.

    ``about`` says whose session it is; ``recent`` are the latest steps, oldest first; ``robot`` has
    the robot's latest status and decision; ``marks`` are goal changes and remarks.
    """
    plan, recent = fold.plan, list(recent)
    entries = (history_entry(audience, plan, step) for step in recent)
    message: Message = {
        "type": "snapshot",
        "number": fold.last_number,
        "state": fold.state.value,
        "completed": fold.completed,
        "about": about,
        "phase": describe_phase(plan, fold.phase_index),
        **describe_walked(fold),
        "unit": plan.measure.unit,
        "has_points": plan.valence.has_points,
        "score": fold.score,
        "streak": fold.feedback.streak
        if plan.valence.rewards or audience is Audience.MONITOR
        else None,
        "target": {"hit_rate": plan.target.hit_rate, "duration_s": plan.target.duration_s},
        "presence": presence if audience is Audience.MONITOR else _near(presence),
        "robot_stopped": robot_stopped,
        "steps": [entry for entry in entries if entry is not None],
    }
    if audience is Audience.PATIENT:
        message["last"] = _last_step(fold, recent)
    if audience is Audience.MONITOR:
        message |= {
            "valence": plan.valence.slug,
            "trained_side": plan.trained_side,
            "marks": list(marks),
            "goal": fold.goal,
            "gain": fold.gain,
            "activation_threshold": fold.activation_threshold,
            "robot_intensity": fold.robot_intensity,
            "hit_rate": fold.feedback.hit_rate,
            "hits": fold.feedback.hits,
            "judged": fold.feedback.judged,
            "obstacle": fold.obstacle,
            "robot": dict(robot),
            "phases": [describe_phase(plan, index) for index in range(len(plan.phases))],
        }
    return message


def _last_step(fold: SessionFold, recent: Sequence[StoredStep]) -> Message | None:
    """Give what the patient was last shown of a step; None before the first."""
    plan = fold.plan
    for step in reversed(recent):
        if step.side == plan.trained_side and Reason.PAUSED not in step.reasons:
            score, streak = fold.score, fold.feedback.streak
            return _patient_step(plan, plan.phases[step.phase], step, score, streak, live=False)
    return None
