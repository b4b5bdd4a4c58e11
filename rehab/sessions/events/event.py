"""An event; and the events of presence, robot, remarks and the source's own goal."""

from __future__ import annotations

import json
from collections.abc import Callable

import msgspec

from rehab.sessions.alarms import OpenAlarms
from rehab.sessions.state_messages import Message
from rehab.training.controls import Audience
from rehab.training.fold import SessionFold

_encode = msgspec.json.Encoder().encode  # 3 instead of 19 µs for a monitor's step


def to_text(message: Message) -> str:
    """Return a message as a frame's text. A number that is not finite becomes null."""
    try:
        return _encode(message).decode()
    except UnicodeEncodeError:  # half a pair of surrogates, which only an escape can write
        return json.dumps(message, separators=(",", ":"), allow_nan=False)


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


def presence_event(fold: SessionFold, presence: Message) -> LiveEvent:
    """Return the event that a source, tablet or robot connected or disconnected."""
    event = {"kind": "presence", "presence": presence}
    for_patient = {"kind": "presence", "presence": presence_for_patient(presence)}
    return event_for(fold, patient=for_patient, monitor=event)


def presence_for_patient(presence: Message) -> Message:
    """Return the part of the presence that a patient's page gets."""
    return {
        "source": presence["source"],
        "ended": presence["source_trouble"] == "ended",  # the recording that played
        "robot": presence["robot"],
    }


def robot_report_event(fold: SessionFold, report: Message) -> LiveEvent:
    """Return the event that the robot reported something."""
    return event_for(fold, monitor={"kind": "robot", "report": report})


def robot_stopped_event(fold: SessionFold, stopped: bool) -> LiveEvent:
    """Return the event that someone stopped the robot, or that a person armed it again."""
    event = {"kind": "robot_stopped", "stopped": stopped}
    return event_for(fold, patient=event, monitor=event)


def robot_state_event(fold: SessionFold, state: str) -> LiveEvent:
    """Return the event with the state that the robot must obey; for the robot alone."""
    return event_for(fold, robot={"type": "state", "state": state})


def remark_event(fold: SessionFold, what: str, value: float | None) -> LiveEvent:
    """Return the event that a PT noted something."""
    event = {"kind": "remark", "what": what, "value": value, "number": fold.last_number}
    return event_for(fold, monitor=event)


def alarms_event(fold: SessionFold, alarms: OpenAlarms) -> LiveEvent:
    """Return the event that an alarm was raised or acknowledged. The patient's page stays calm."""
    patient = {"kind": "alarms", **alarms.describe_to_patient()}
    return event_for(fold, patient=patient, monitor={"kind": "alarms", **alarms.describe()})


def source_goal_event(fold: SessionFold, goal: float) -> LiveEvent:
    """Return the event that a source has another goal than the PT's."""
    return event_for(fold, monitor={"kind": "source_goal", "goal": goal})


def event_for(fold: SessionFold, **messages: Message) -> LiveEvent:
    return LiveEvent(fold.last_number, lambda audience: messages.get(audience.value))
