"""What happens in a live session, as each kind of viewer hears it. Nothing here does anything."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

from rehab.sessions.payloads import (
    Message,
    change_mark,
    describe_cue,
    describe_now,
    describe_phase,
    describe_state,
    describe_types,
    describe_walked,
    type_mark,
)
from rehab.training.changes import ChangeKind, ChangeValue
from rehab.training.fold import SessionFold
from rehab.training.phases import Phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import InvalidReason, ScoredStep
from rehab.training.valences import Valence


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


@dataclass(frozen=True, slots=True)
class Told:
    """What a step is told by: as it was when the step came, whatever has changed since."""

    phase: Phase
    valence: Valence
    words_shown: bool
    chart_style: str

    @classmethod
    def now(cls, fold: SessionFold) -> Told:
        """Give what the next step is told by."""
        return cls(fold.phase, fold.valence, fold.words_shown, fold.chart_style.value)


def step_event(fold: SessionFold, told: Told, step: ScoredStep, *, live: bool) -> LiveEvent:
    """Give the event of a step that was just scored.

    ``live`` is False for a step that came too late to be shown as one.
    """
    tally, score, plan, walked = fold.feedback, fold.score, fold.plan, describe_walked(fold)
    streak, hits, judged = tally.streak, tally.hits, tally.judged

    def build(audience: Audience) -> Message | None:
        match audience:
            case Audience.PATIENT:
                shown = _patient_step(plan, told, step, score, streak, live=live)
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
                return _robot_step(told.phase, step, live=live)

    return LiveEvent(step.number, build)


def _patient_step(
    plan: SessionPlan,
    told: Told,
    step: StoredStep,
    score: int | None,
    streak: int,
    *,
    live: bool,
) -> Message | None:
    if step.side != plan.trained_side:
        return None
    if not told.phase.feedback:
        return {"kind": "calm", "number": step.number}
    if step.performance is None or step.hit is None:
        return {"kind": "missing", "number": step.number, "live": live}
    valence, band = told.valence, told.valence.band(step.performance)
    return {
        "kind": "step",
        "number": step.number,
        "live": live,
        "performance": round(step.performance, 4),
        "hit": step.hit,
        "words": band.words if told.words_shown else "",
        "chart": told.chart_style,
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


def _robot_step(phase: Phase, step: ScoredStep, *, live: bool) -> Message | None:
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


def state_event(fold: SessionFold) -> LiveEvent:
    """Give the event that a session started, paused, went on or ended."""
    page = {"kind": "state", **describe_state(fold)}
    robot = {"type": "state", "state": fold.state.value}
    return _to_each(fold, patient=page, monitor=page, robot=robot)


def phase_event(fold: SessionFold, *, switched: bool = False) -> LiveEvent:
    """Give the event that a phase began; ``switched`` where it has another feedback type."""
    phase = {"kind": "phase", **describe_now(fold)}
    streak = {"streak": fold.feedback.streak if fold.valence.rewards else None}
    monitor = phase | {"goal": fold.goal, "gain": fold.gain, "obstacle": fold.obstacle}
    monitor |= describe_types(fold)
    if not switched:
        return _to_each(fold, patient=phase | streak, monitor=monitor)
    monitor["mark"] = type_mark(fold.last_number, fold.valence.slug)
    return _to_each(fold, patient=phase | streak, monitor=monitor, robot=_cue(fold))


def change_event(fold: SessionFold, kind: ChangeKind, value: ChangeValue = None) -> LiveEvent:
    """Give the event of any change that a person made."""
    told: Message
    match kind:
        case ChangeKind.GOAL:
            value, told = fold.goal, {"goal": fold.goal}
        case ChangeKind.GAIN:
            value, told = fold.gain, {"gain": fold.gain}
        case ChangeKind.ACTIVATION_THRESHOLD:
            value, told = fold.activation_threshold, {"value": fold.activation_threshold}
        case ChangeKind.ROBOT_INTENSITY:
            value, told = fold.robot_intensity, {"value": fold.robot_intensity}
        case ChangeKind.VALENCE:
            told = describe_types(fold)
        case ChangeKind.FEEDBACK_TEXT:
            told = {}
        case ChangeKind.WORDS_SHOWN:
            value, told = float(fold.words_shown), {"value": fold.words_shown}
        case ChangeKind.CHART_STYLE:
            value, told = fold.chart_style.value, {"value": fold.chart_style.value}
        case ChangeKind.PHASE:
            return phase_event(fold)
        case _:
            return state_event(fold)
    monitor = {"kind": kind.value, **told, "mark": change_mark(fold.last_number, kind, value)}
    if kind in (ChangeKind.ACTIVATION_THRESHOLD, ChangeKind.ROBOT_INTENSITY):
        return _to_each(fold, monitor=monitor, robot=_cue(fold))
    return _to_each(fold, monitor=monitor)


def _cue(fold: SessionFold) -> Message:
    return {"type": "cue", "cue": describe_cue(fold), "valence": fold.valence.slug}


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
    the robot's latest status and decision; ``marks`` are changes and remarks.
    """
    plan, recent = fold.plan, list(recent)
    entries = (history_entry(audience, plan, step) for step in recent)
    message: Message = {
        "type": "snapshot",
        "number": fold.last_number,
        **describe_state(fold),
        "completed": fold.completed,
        "about": about,
        **describe_now(fold),
        "unit": plan.measure.unit,
        "streak": fold.feedback.streak
        if fold.valence.rewards or audience is Audience.MONITOR
        else None,
        "chart": fold.chart_style.value,
        "target": {"hit_rate": plan.target.hit_rate, "duration_s": plan.target.duration_s},
        "presence": presence if audience is Audience.MONITOR else _near(presence),
        "robot_stopped": robot_stopped,
        "steps": [entry for entry in entries if entry is not None],
    }
    if audience is Audience.PATIENT:
        message["last"] = _last_step(fold, recent)
    if audience is Audience.MONITOR:
        message |= {
            **describe_types(fold),
            "words_shown": fold.words_shown,
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
            "phases": [
                describe_phase(plan, index, fold.valence) for index in range(len(plan.phases))
            ],
        }
    return message


def _last_step(fold: SessionFold, recent: Sequence[StoredStep]) -> Message | None:
    """Give what the patient was last shown of a step; None before the first."""
    plan, told = fold.plan, Told.now(fold)
    switched_after = fold.switches[-1][0] if fold.switches else 0
    for step in reversed(recent):
        if step.number <= switched_after:
            return None  # it meant something else
        if step.side == plan.trained_side and InvalidReason.PAUSED not in step.reasons:
            score, streak = fold.score, fold.feedback.streak
            told = replace(told, phase=plan.phases[step.phase])
            return _patient_step(plan, told, step, score, streak, live=False)
    return None
