"""Events of changes: the message for each audience, by the control that was used."""

from __future__ import annotations

from collections.abc import Callable

from rehab.sessions.events.event import LiveEvent, event_for
from rehab.sessions.state_messages import (
    Message,
    change_mark,
    describe_cue,
    describe_now,
    describe_robot_state,
    describe_source_phase,
    describe_state,
    describe_types,
    type_mark,
)
from rehab.training.changes import ChangeValue
from rehab.training.controls import CONTROLS, Audience, Control, Payload
from rehab.training.fold import SessionFold


def change_event(fold: SessionFold, kind: str, value: ChangeValue = None) -> LiveEvent:
    """Return the event of a change, with its control's message for each audience."""
    control = CONTROLS[kind]
    messages = {
        audience.value: PAYLOADS[audience, payload](fold, control, value)
        for audience, payload in control.payloads.items()
        if audience is not Audience.SOURCE  # which gets `source_message` before the acknowledgment
    }
    return event_for(fold, **messages)


def phase_event(fold: SessionFold, *, switched: bool = False) -> LiveEvent:
    """Return the event that a phase began; ``switched`` where it has another feedback type."""
    patient, monitor = _phase_for_patient(fold), _phase_for_monitor(fold)
    if switched:
        monitor["mark"] = type_mark(fold.last_number, fold.valence.slug)
    # A phase decides what its robot may do beside answers.
    return event_for(fold, patient=patient, monitor=monitor, robot=_cue(fold))


def cue_event(fold: SessionFold) -> LiveEvent:
    """Return the event that the robot's order is another one."""
    return event_for(fold, robot=_cue(fold))


def source_message(fold: SessionFold, kind: str) -> Message | None:
    """Return the message to a source about a change, as of now; None for none."""
    control = CONTROLS[kind]
    payload = control.payloads.get(Audience.SOURCE)
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


def _marked(fold: SessionFold, control: Control, value: ChangeValue, payload: Message) -> Message:
    """Return a change as sent to the PT's page, with its mark where charts have one."""
    message: Message = {"kind": str(control.kind), **payload}
    if control.mark is not None:
        in_force = control.value_for_log(fold)
        shown = value if in_force is None else in_force
        message["mark"] = change_mark(fold.last_number, control.kind, shown)
    return message


def _value(fold: SessionFold, control: Control) -> Message:
    return {control.event_field: control.value_in_force(fold)}


# The message of a change for each audience (`Control.payloads`).
PAYLOADS: dict[tuple[Audience, Payload], Callable[[SessionFold, Control, ChangeValue], Message]] = {
    (Audience.PATIENT, Payload.STATE): lambda fold, _control, _value: _state(fold),
    (Audience.PATIENT, Payload.LANGUAGE): lambda fold, control, _value: {
        "kind": str(control.kind),
        "language": fold.valences.language,
    },
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
    (Audience.ROBOT, Payload.STATE): lambda fold, control, _value: describe_robot_state(
        fold, control.kind
    ),
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
