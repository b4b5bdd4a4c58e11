"""What people and the server do to a session between steps, and the states of a session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from rehab.training.measures import InvalidSetting
from robot.marking import gettext_noop


class State(StrEnum):
    """Where a session stands: ready → running ⇄ paused → finished or aborted."""

    READY = "ready"
    RUNNING = "running"
    PAUSED = "paused"
    FINISHED = "finished"
    ABORTED = "aborted"


class ChangeKind(StrEnum):
    """Changes that code names; what each is and does: ``rehab.training.controls``."""

    START = gettext_noop("start")
    PAUSE = gettext_noop("pause")
    RESUME = gettext_noop("resume")
    FINISH = gettext_noop("finish")
    ABORT = gettext_noop("abort")
    GOAL = gettext_noop("goal")
    GAIN = gettext_noop("gain")
    PHASE = gettext_noop("phase")
    ACTIVATION_THRESHOLD = gettext_noop("activation_threshold")
    ROBOT_INTENSITY = gettext_noop("robot_intensity")
    VALENCE = gettext_noop("valence")
    VALENCE_NOW = gettext_noop("valence_now")
    FEEDBACK_TEXT = gettext_noop("feedback_text")
    WORDS_SHOWN = gettext_noop("words_shown")
    CHART_STYLE = gettext_noop("chart_style")
    GOAL_ADAPTATION = gettext_noop("goal_adaptation")


class PauseReason(StrEnum):
    """Why a session is paused."""

    THERAPIST = "therapist"
    PATIENT = "patient"
    RESTART = "restart"  # of the server
    REST = "rest"  # that the plan has after a phase
    HEART_RATE = "heart_rate"  # above the plan's limit


ChangeValue = float | str | Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class Change:
    """One change of a session.

    Attributes
    ----------
    kind
        What changes: a key of ``rehab.training.controls.CONTROLS``.
    value
        The new goal, gain, threshold, intensity or phase index; 1 or 0 for words shown or not; the
        slug of a valence, a chart style, an adaptation mode or the reason of a pause; for
        feedback text, the valence and its bands. None for the others.
    """

    kind: str
    value: ChangeValue = None


class NotAllowed(InvalidSetting):
    """A change or step that the session's state does not allow; the message says what would be."""


OPEN_STATES = frozenset({State.READY, State.RUNNING, State.PAUSED})
ENDED_STATES = frozenset({State.FINISHED, State.ABORTED})

# What people call them; pages translate it.
STATE_LABELS = {
    State.READY: gettext_noop("ready"),
    State.RUNNING: gettext_noop("running"),
    State.PAUSED: gettext_noop("paused"),
    State.FINISHED: gettext_noop("finished"),
    State.ABORTED: gettext_noop("ended early"),
}
