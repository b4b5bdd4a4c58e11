"""A robot's reports to the server (docs/protocol.md), and its status by lights and sounds."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from robot.bases import BaseState, Indication, MobileBase
from robot.behavior.answer_choice import Choice
from robot.behavior.safety import BATTERY_WARN_V, battery_share
from robot.behavior.window_decider import Decision
from robot.motion.face_and_arms import REST, look_of
from robot.motion.gesture import Gesture
from robot.motion.lights_and_sounds import Color

# What the lights of a base say where no score is played; pages show the same of every base.
LIGHTS = {
    Indication.WAITING: ("off", "off"),
    Indication.READY: ("green", "off"),
    Indication.MOVING: ("orange", "off"),
    Indication.STOPPED: ("red", "off"),
}

# What a base shows in these states; it is ready where it is idle for no reason, and else waits.
SHOWN = {"stopped": Indication.STOPPED, "performing": Indication.MOVING}

STATUS_MOVING_S = 0.25
STATUS_IDLE_S = 1.0
MAX_REPORTS = 64  # while they cannot be sent, the oldest are dropped
REPORTED = ("from_s", "until_s", "steps", "mean", "threshold", "above")  # of a decision

Report = dict[str, Any]
RobotState = tuple[str, str]  # the robot's state, and why it would not perform now


class StatusReporter:
    """Collects reports until they are sent, and shows the state by lights and sounds.

    Parameters
    ----------
    base
        The base with the lights and sounds.

    Attributes
    ----------
    reports
        Reports to send, oldest first; the sender pops them from the left.
    on_report
        Called with each report when it is made.
    """

    def __init__(self, base: MobileBase) -> None:
        self.reports: deque[Report] = deque(maxlen=MAX_REPORTS)
        self.on_report: Callable[[Report], None] = lambda _report: None
        self._base = base
        # Where the base has notes, a gesture's own score says aloud that it moves.
        self._aloud = {Indication.STOPPED}
        if not base.abilities.notes:
            self._aloud.add(Indication.MOVING)
        self._reported_s: float | None = None  # the last status
        self._reported: tuple[RobotState, str | None] | None = None
        self._performing: Gesture | None = None  # since when its look counts
        self._began_s = 0.0
        self._indication: Indication | None = None

    def reset(self) -> None:
        """Make the next status due at once, for a server that knows nothing yet."""
        self._reported_s = None

    def report(self, report: Report) -> None:
        """Queue a report."""
        self.reports.append(report)
        self.on_report(report)

    def report_gesture(
        self, gesture: Gesture, phase: str, outcome: str, choice: Choice | None = None
    ) -> None:
        """Report that a gesture has started or ended.

        Parameters
        ----------
        gesture
            The gesture.
        phase
            ``started`` or ``ended``.
        outcome
            How it ended, as a code; empty at its start.
        choice
            Which pool it is from, and by which seed, where no decision reports that.
        """
        report: Report = {"kind": "gesture", "name": gesture.name}
        report |= {"phase": phase, "outcome": outcome}
        if choice is not None:
            report |= {"pool": choice.pool, "seed": choice.seed}
        is_open = not self._base.abilities.closed_loop
        self.report(report | {"open_loop": True} if is_open else report)

    def report_decision(
        self,
        decision: Decision,
        share: float | None,
        gesture: str | None = None,
        intensity: float | None = None,
        reason: str = "",
        choice: Choice | None = None,
    ) -> None:
        """Report a decision, and the gesture that follows or why none does.

        Parameters
        ----------
        decision
            The result of a window.
        share
            The share of windows that were above the threshold, 0 to 1.
        gesture, intensity
            The gesture's name, and the share of its size, 0.1 to 1; None where none follows.
        reason
            Why none follows, as a code.
        choice
            Which pool the gesture is from, and by which seed; None for one that the cue names.
        """
        report: Report = {
            "kind": "decision",
            "gesture": gesture,
            "intensity": intensity,
            "reason": reason,
        }
        decided = {name: getattr(decision, name) for name in REPORTED}
        if choice is not None:
            report |= {"pool": choice.pool, "seed": choice.seed}
        self.report(report | decided | {"activated_share": share})

    def report_status(
        self,
        now_s: float,
        state: RobotState,
        there: BaseState,
        *,
        gesture: Gesture | None,
        lights: tuple[Color, Color] | None,
        bad_messages: int,
        counters: Mapping[str, int],
        homing: str | None = None,
    ) -> None:
        """Report the status where it has changed, and every so often.

        Parameters
        ----------
        now_s
            The time [s].
        state
            The robot's state, and why it would not perform now.
        there
            What its base reports.
        gesture
            What it plays; None for nothing.
        lights
            Those of the score that is played; None where none is.
        bad_messages
            How many messages broke the protocol.
        counters
            How often something went wrong, by name; those at 0 are omitted.
        homing
            How its way home by a tag goes, as a code; None where it has learned no tag.
        """
        every_s = STATUS_IDLE_S if gesture is None else STATUS_MOVING_S
        due = self._reported_s is None or not 0 <= now_s - self._reported_s < every_s
        if not due and (state, homing) == self._reported:
            return
        self._reported_s, self._reported = now_s, (state, homing)
        if gesture is None or self._performing is not gesture:
            self._performing, self._began_s = gesture, now_s
        look = REST
        if gesture is not None:
            look = look_of(gesture.name, gesture.score.mood, now_s - self._began_s)
        volts, abilities = there.sensors.battery_v, self._base.abilities
        self.report(
            {
                "kind": "status",
                "base": self._base.name,
                "simulated": abilities.simulated,
                "open_loop": not abilities.closed_loop,
                "bumpers": abilities.bumpers,
                "state": state[0],
                "gesture": None if gesture is None else gesture.name,
                "pose": asdict(there.pose),
                "reason": state[1],
                "battery_v": volts,
                "battery_share": None if volts is None else battery_share(volts),
                "battery_low": volts is not None and volts < BATTERY_WARN_V,
                "bad_messages": bad_messages,
                "counters": {name: count for name, count in counters.items() if count},
                "lights": list(lights or LIGHTS[self._indication or Indication.WAITING]),
                "mood": "calm" if gesture is None else gesture.score.mood,
                "look": [look.mouth, look.eyes],
                "homing": homing,
            }
        )

    def show(self, state: RobotState, *, is_quiet: bool) -> None:
        """Show a state by the base's lights, and by a sound unless it is quiet."""
        indication = SHOWN.get(state[0], Indication.WAITING)
        if state == ("idle", ""):
            indication = Indication.READY
        if indication is not self._indication:
            self._indication = indication
            self._base.show(indication, aloud=not is_quiet and indication in self._aloud)
