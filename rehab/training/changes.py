"""What people and the server do to a session between steps, and which states allow it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from rehab.training.measures import InvalidSetting


class State(StrEnum):
    """Where a session stands: ready → running ⇄ paused → finished or aborted."""

    READY = "ready"
    RUNNING = "running"
    PAUSED = "paused"
    FINISHED = "finished"
    ABORTED = "aborted"


class ChangeKind(StrEnum):
    """What can change the way that later steps are scored."""

    START = "start"
    PAUSE = "pause"
    RESUME = "resume"
    FINISH = "finish"
    ABORT = "abort"
    GOAL = "goal"
    GAIN = "gain"
    PHASE = "phase"
    ACTIVATION_THRESHOLD = "activation_threshold"
    ROBOT_INTENSITY = "robot_intensity"


@dataclass(frozen=True, slots=True)
class Change:
    """One change. ``value``: the new goal, gain, threshold, intensity or phase index, or None."""

    kind: ChangeKind
    value: float | None = None


class Refused(InvalidSetting):
    """A change that the session's state does not allow; the message says what would be needed."""


OPEN = frozenset({State.READY, State.RUNNING, State.PAUSED})
ENDED = frozenset({State.FINISHED, State.ABORTED})

# kind: (states it may come in, state it leads to; None where the state stays)
TRANSITIONS: dict[ChangeKind, tuple[frozenset[State], State | None]] = {
    ChangeKind.START: (frozenset({State.READY}), State.RUNNING),
    ChangeKind.PAUSE: (frozenset({State.RUNNING}), State.PAUSED),
    ChangeKind.RESUME: (frozenset({State.PAUSED}), State.RUNNING),
    ChangeKind.FINISH: (frozenset({State.RUNNING, State.PAUSED}), State.FINISHED),
    ChangeKind.ABORT: (OPEN, State.ABORTED),
    ChangeKind.GOAL: (OPEN, None),
    ChangeKind.GAIN: (OPEN, None),
    ChangeKind.PHASE: (OPEN, None),
    ChangeKind.ACTIVATION_THRESHOLD: (OPEN, None),
    ChangeKind.ROBOT_INTENSITY: (OPEN, None),
}


def next_state(state: State, kind: ChangeKind) -> State:
    """Give the state after a change. Raises Refused, saying when it would be allowed."""
    allowed, leads_to = TRANSITIONS[kind]
    if state not in allowed:
        raise Refused(
            f"A session that is {state} cannot take the change '{kind}'; "
            f"it must be {' or '.join(sorted(allowed))}."
        )
    return leads_to or state
