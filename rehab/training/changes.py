"""What people and the server do to a session between steps, and which states allow it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from rehab.training.marking import AnyOf, Marked, gettext_noop
from rehab.training.measures import InvalidSetting


class State(StrEnum):
    """Where a session stands: ready → running ⇄ paused → finished or aborted."""

    READY = "ready"
    RUNNING = "running"
    PAUSED = "paused"
    FINISHED = "finished"
    ABORTED = "aborted"


class ChangeKind(StrEnum):
    """What can change the way that later steps are scored or shown."""

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
    VALENCE = "valence"  # of the next phase with feedback
    FEEDBACK_TEXT = "feedback_text"  # the bands of a valence, as the clinic edited them
    WORDS_SHOWN = "words_shown"
    CHART_STYLE = "chart_style"


# What pages and programs ask for. Words are edited with their feedback type, for all open sessions.
REQUESTABLE = tuple(kind for kind in ChangeKind if kind is not ChangeKind.FEEDBACK_TEXT)


class PauseReason(StrEnum):
    """Why a session is paused."""

    THERAPIST = "therapist"
    PATIENT = "patient"
    RESTART = "restart"  # of the server


ChangeValue = float | str | Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class Change:
    """One change of a session.

    Attributes
    ----------
    kind
        What changes.
    value
        The new goal, gain, threshold, intensity or phase index; 1 or 0 for words shown or not; the
        slug of a valence, a chart style or the reason of a pause; for feedback text, the valence
        and its bands. None for the others.
    """

    kind: ChangeKind
    value: ChangeValue = None

    @property
    def number(self) -> float:
        """The value as a number. Raises InvalidSetting where it is none."""
        value: object = self.value  # JSON knows true and false beside numbers
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidSetting(
                "The change '{kind}' needs a value, and that is a number.",
                kind=Marked(CHANGE_LABELS[self.kind]),
            )
        return value

    @property
    def switch(self) -> bool:
        """The value as on (1) or off (0). Raises InvalidSetting where it is neither."""
        if self.number not in (0, 1):
            raise InvalidSetting("Words are shown (1) or not (0).")
        return self.number == 1


class NotAllowed(InvalidSetting):
    """A change or step that the session's state does not allow; the message says what would be."""


OPEN_STATES = frozenset({State.READY, State.RUNNING, State.PAUSED})
ENDED_STATES = frozenset({State.FINISHED, State.ABORTED})

# kind: (states it may come in, state it leads to; None where the state stays)
TRANSITIONS: dict[ChangeKind, tuple[frozenset[State], State | None]] = {
    ChangeKind.START: (frozenset({State.READY}), State.RUNNING),
    ChangeKind.PAUSE: (frozenset({State.RUNNING}), State.PAUSED),
    ChangeKind.RESUME: (frozenset({State.PAUSED}), State.RUNNING),
    ChangeKind.FINISH: (frozenset({State.RUNNING, State.PAUSED}), State.FINISHED),
    ChangeKind.ABORT: (OPEN_STATES, State.ABORTED),
    ChangeKind.GOAL: (OPEN_STATES, None),
    ChangeKind.GAIN: (OPEN_STATES, None),
    ChangeKind.PHASE: (OPEN_STATES, None),
    ChangeKind.ACTIVATION_THRESHOLD: (OPEN_STATES, None),
    ChangeKind.ROBOT_INTENSITY: (OPEN_STATES, None),
    ChangeKind.VALENCE: (OPEN_STATES, None),
    ChangeKind.FEEDBACK_TEXT: (OPEN_STATES, None),
    ChangeKind.WORDS_SHOWN: (OPEN_STATES, None),
    ChangeKind.CHART_STYLE: (OPEN_STATES, None),
}


# How refusals name them: programs know these words, and pages have them translated.
STATE_LABELS = {
    State.READY: gettext_noop("ready"),
    State.RUNNING: gettext_noop("running"),
    State.PAUSED: gettext_noop("paused"),
    State.FINISHED: gettext_noop("finished"),
    State.ABORTED: gettext_noop("aborted"),
}
CHANGE_LABELS = {
    ChangeKind.START: gettext_noop("start"),
    ChangeKind.PAUSE: gettext_noop("pause"),
    ChangeKind.RESUME: gettext_noop("resume"),
    ChangeKind.FINISH: gettext_noop("finish"),
    ChangeKind.ABORT: gettext_noop("abort"),
    ChangeKind.GOAL: gettext_noop("goal"),
    ChangeKind.GAIN: gettext_noop("gain"),
    ChangeKind.PHASE: gettext_noop("phase"),
    ChangeKind.ACTIVATION_THRESHOLD: gettext_noop("activation_threshold"),
    ChangeKind.ROBOT_INTENSITY: gettext_noop("robot_intensity"),
    ChangeKind.VALENCE: gettext_noop("valence"),
    ChangeKind.FEEDBACK_TEXT: gettext_noop("feedback_text"),
    ChangeKind.WORDS_SHOWN: gettext_noop("words_shown"),
    ChangeKind.CHART_STYLE: gettext_noop("chart_style"),
}


def next_state(state: State, kind: ChangeKind) -> State:
    """Return the state after a change.

    Raises
    ------
    NotAllowed
        Naming the states in which the change would be allowed.
    """
    allowed, leads_to = TRANSITIONS[kind]
    if state not in allowed:
        raise NotAllowed(
            "A session that is {state} cannot take the change '{kind}'; it must be {allowed}.",
            state=Marked(STATE_LABELS[state]),
            kind=Marked(CHANGE_LABELS[kind]),
            allowed=AnyOf(sorted(STATE_LABELS[each] for each in allowed)),
        )
    return leads_to or state
