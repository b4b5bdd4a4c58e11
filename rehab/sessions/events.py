"""The events of a live session as messages for each audience. Pure: nothing is sent here."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from rehab.sessions.payloads import (
    Message,
    change_mark,
    describe_cue,
    describe_now,
    describe_phase,
    describe_source_phase,
    describe_state,
    describe_types,
    describe_walked,
    type_mark,
)
from rehab.training.changes import ChangeValue
from rehab.training.controls import CONTROLS, Audience, Control, Payload
from rehab.training.fold import SessionFold
from rehab.training.phases import Phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import InvalidReason, ScoredStep
from rehab.training.valences import Valence

_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False).encode


def to_text(message: Message) -> str:
    """Return a message as a frame's text."""
    return _encode(message)


class LiveEvent:
    """One event. Its text for an audience is built once, on first use."""

    __slots__ = ("_build", "_texts", "number")

    def __init__(self, number: int, build: Callable[[Audience], Message | None]) -> None:
        self.number = number  # the last step at that moment
        self._build = build
        self._texts: dict[Audience, str | None] = {}

    def text(self, audience: Audience) -> str | None:
        """Return this audience's message as text; None for no message."""
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
class StepContext:
    """What a step's feedback follows from, as it was when the step came."""

    phase: Phase
    valence: Valence
    words_shown: bool
    chart_style: str

    @classmethod
    def of(cls, fold: SessionFold) -> StepContext:
        """Return the context of the next step."""
        return cls(fold.phase, fold.valence, fold.words_shown, fold.chart_style.value)


def step_event(
    fold: SessionFold, context: StepContext, step: ScoredStep, *, live: bool
) -> LiveEvent:
    """Return the event of a step that was just scored.

    ``live`` is False for a step that came too late to be shown as one.
    """
    tally, score, plan, walked = fold.feedback, fold.score, fold.plan, describe_walked(fold)
    streak, hits, judged = tally.streak, tally.hits, tally.judged

    def build(audience: Audience) -> Message | None:
        match audience:
            case Audience.PATIENT:
                shown = _patient_step(plan, context, step, score, streak, live=live)
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
                return _robot_step(context.phase, step, live=live)
            case Audience.SOURCE:
                return None

    return LiveEvent(step.number, build)


def _patient_step(
    plan: SessionPlan,
    context: StepContext,
    step: StoredStep,
    score: int | None,
    streak: int,
    *,
    live: bool,
) -> Message | None:
    if step.side != plan.trained_side:
        return None
    if not context.phase.feedback:
        return {"kind": "calm", "number": step.number}
    if step.performance is None or step.hit is None:
        return {"kind": "missing", "number": step.number, "live": live}
    valence, band = context.valence, context.valence.band(step.performance)
    return {
        "kind": "step",
        "number": step.number,
        "live": live,
        "performance": round(step.performance, 4),
        "hit": step.hit,
        "words": band.words if context.words_shown else "",
        "chart": context.chart_style,
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


def change_event(fold: SessionFold, kind: str, value: ChangeValue = None) -> LiveEvent:
    """Return the event of a change, with what its control tells each audience."""
    control = CONTROLS[kind]
    messages = {
        audience.value: PAYLOADS[audience, payload](fold, control, value)
        for audience, payload in control.tells.items()
        if audience is not Audience.SOURCE  # which gets `source_message` before the acknowledgment
    }
    return _event_for(fold, **messages)


def phase_event(fold: SessionFold, *, switched: bool = False) -> LiveEvent:
    """Return the event that a phase began; ``switched`` where it has another feedback type."""
    patient, monitor = _phase_for_patient(fold), _phase_for_monitor(fold)
    if not switched:
        return _event_for(fold, patient=patient, monitor=monitor)
    monitor["mark"] = type_mark(fold.last_number, fold.valence.slug)
    return _event_for(fold, patient=patient, monitor=monitor, robot=_cue(fold))


def source_message(fold: SessionFold, kind: str) -> Message | None:
    """Return what a source is told of a change, as of now; None for nothing."""
    control = CONTROLS[kind]
    payload = control.tells.get(Audience.SOURCE)
    return None if payload is None else PAYLOADS[Audience.SOURCE, payload](fold, control, None)


def _state(fold: SessionFold) -> Message:
    return {"kind": "state", **describe_state(fold)}


def _phase_for_patient(fold: SessionFold) -> Message:
    streak = fold.feedback.streak if fold.valence.rewards else None
    return {"kind": "phase", **describe_now(fold), "streak": streak}


def _phase_for_monitor(fold: SessionFold) -> Message:
    return {
        "kind": "phase",
        **describe_now(fold),
        "goal": fold.goal,
        "gain": fold.gain,
        "obstacle": fold.obstacle,
        **describe_types(fold),
    }


def _cue(fold: SessionFold) -> Message:
    return {"type": "cue", "cue": describe_cue(fold), "valence": fold.valence.slug}


def _marked(fold: SessionFold, control: Control, value: ChangeValue, told: Message) -> Message:
    """Return a change as the PT's page hears it, with its mark where charts have one."""
    message: Message = {"kind": str(control.kind), **told}
    if control.mark is not None:
        in_force = control.value_for_log(fold)
        shown = value if in_force is None else in_force
        message["mark"] = change_mark(fold.last_number, control.kind, shown)
    return message


def _value(fold: SessionFold, control: Control) -> Message:
    return {control.event_field: control.value_in_force(fold)}


# What each audience is told of a change (`Control.tells`).
PAYLOADS: dict[tuple[Audience, Payload], Callable[[SessionFold, Control, ChangeValue], Message]] = {
    (Audience.PATIENT, Payload.STATE): lambda fold, _control, _value: _state(fold),
    (Audience.PATIENT, Payload.PHASE): lambda fold, _control, _value: _phase_for_patient(fold),
    (Audience.MONITOR, Payload.KIND): lambda fold, control, value: _marked(
        fold, control, value, {}
    ),
    (Audience.MONITOR, Payload.VALUE): lambda fold, control, value: _marked(
        fold, control, value, _value(fold, control)
    ),
    (Audience.MONITOR, Payload.TYPES): lambda fold, control, value: _marked(
        fold, control, value, describe_types(fold)
    ),
    (Audience.MONITOR, Payload.STATE): lambda fold, _control, _value: _state(fold),
    (Audience.MONITOR, Payload.PHASE): lambda fold, _control, _value: _phase_for_monitor(fold),
    (Audience.ROBOT, Payload.STATE): lambda fold, _control, _value: {
        "type": "state",
        "state": fold.state.value,
    },
    (Audience.ROBOT, Payload.CUE): lambda fold, _control, _value: _cue(fold),
    (Audience.SOURCE, Payload.KIND): lambda _fold, control, _value: {"type": str(control.kind)},
    (Audience.SOURCE, Payload.VALUE): lambda fold, control, _value: {
        "type": str(control.kind),
        control.event_field: control.value_in_force(fold),
    },
    (Audience.SOURCE, Payload.PHASE): lambda fold, control, _value: {
        "type": str(control.kind),
        "phase": describe_source_phase(fold),
    },
    (Audience.SOURCE, Payload.STOP): lambda _fold, _control, _value: {"type": "stop"},
}


def presence_event(fold: SessionFold, presence: Message) -> LiveEvent:
    """Return the event that a source, tablet or robot came or went."""
    event = {"kind": "presence", "presence": presence}
    for_patient = {"kind": "presence", "presence": _presence_for_patient(presence)}
    return _event_for(fold, patient=for_patient, monitor=event)


def _presence_for_patient(presence: Message) -> Message:
    """Return what a patient is told of who is there."""
    return {"source": presence["source"], "robot": presence["robot"]}


def robot_report_event(fold: SessionFold, report: Message) -> LiveEvent:
    """Return the event that the robot reported something."""
    return _event_for(fold, monitor={"kind": "robot", "report": report})


def robot_stopped_event(fold: SessionFold, stopped: bool) -> LiveEvent:
    """Return the event that someone stopped the robot, or that a person armed it again."""
    event = {"kind": "robot_stopped", "stopped": stopped}
    return _event_for(fold, patient=event, monitor=event)


def remark_event(fold: SessionFold, what: str, value: float | None) -> LiveEvent:
    """Return the event that a PT noted something."""
    event = {"kind": "remark", "what": what, "value": value, "number": fold.last_number}
    return _event_for(fold, monitor=event)


def source_goal_event(fold: SessionFold, goal: float) -> LiveEvent:
    """Return the event that a source believes in another goal than the PT's."""
    return _event_for(fold, monitor={"kind": "source_goal", "goal": goal})


def _event_for(fold: SessionFold, **messages: Message) -> LiveEvent:
    return LiveEvent(fold.last_number, lambda audience: messages.get(audience.value))


def history_entry(audience: Audience, plan: SessionPlan, step: StoredStep) -> Message | None:
    """Return a past step as a chart needs it; None where this audience sees none."""
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
    """Return all that a page of this audience shows, as of the last committed step.

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
        **_controls_for(audience, fold),
        "target": {"hit_rate": plan.target.hit_rate, "duration_s": plan.target.duration_s},
        "presence": presence if audience is Audience.MONITOR else _presence_for_patient(presence),
        "robot_stopped": robot_stopped,
        "steps": [entry for entry in entries if entry is not None],
    }
    if audience is Audience.PATIENT:
        message["last"] = _last_step(fold, recent)
    if audience is Audience.MONITOR:
        message |= {
            **describe_types(fold),
            "trained_side": plan.trained_side,
            "marks": list(marks),
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


def _controls_for(audience: Audience, fold: SessionFold) -> Message:
    return {
        control.snapshot_field: control.value_in_force(fold)
        for control in CONTROLS.values()
        if control.snapshot_field and audience in control.snapshot_for
    }


def _last_step(fold: SessionFold, recent: Sequence[StoredStep]) -> Message | None:
    """Return what the patient was last shown of a step; None before the first."""
    plan, context = fold.plan, StepContext.of(fold)
    switched_after = fold.switches[-1][0] if fold.switches else 0
    for step in reversed(recent):
        if step.number <= switched_after:
            return None  # it meant something else
        if step.side == plan.trained_side and InvalidReason.PAUSED not in step.reasons:
            score, streak = fold.score, fold.feedback.streak
            context = replace(context, phase=plan.phases[step.phase])
            return _patient_step(plan, context, step, score, streak, live=False)
    return None
