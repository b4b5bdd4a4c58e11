"""A robot's status: reports to the server, lights and sounds for people."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from robot.bases import BaseState, Indication, MobileBase
from robot.behavior.reports import Report, gesture_report, status_report
from robot.behavior.safety import BATTERY_WARN_V, battery_share
from robot.motion.gesture import Gesture
from robot.motion.score import Color

# What the lights of a base say where no score is played; pages show the same of every base.
LIGHTS = {
    Indication.WAITING: ("off", "off"),
    Indication.READY: ("green", "off"),
    Indication.MOVING: ("orange", "off"),
    Indication.STOPPED: ("red", "off"),
}

STATUS_MOVING_S = 0.25
STATUS_IDLE_S = 1.0
REPORTS_KEPT = 64  # while nobody sends them, the oldest are dropped

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
        self.reports: deque[Report] = deque(maxlen=REPORTS_KEPT)
        self.on_report: Callable[[Report], None] = lambda _report: None
        self._base = base
        # Where the base has notes, a gesture's own score says aloud that it moves.
        self._aloud = {Indication.STOPPED}
        if not base.abilities.notes:
            self._aloud.add(Indication.MOVING)
        self._reported_s: float | None = None  # the last status
        self._reported: RobotState | None = None
        self._indication: Indication | None = None

    def reset(self) -> None:
        """Make the next status due at once, for a server that knows nothing yet."""
        self._reported_s = None

    def report(self, report: Report) -> None:
        """Queue a report."""
        self.reports.append(report)
        self.on_report(report)

    def report_gesture(self, gesture: Gesture, phase: str, outcome: str) -> None:
        """Report that a gesture has started or ended."""
        is_open = not self._base.abilities.closed_loop
        self.report(gesture_report(gesture.name, phase, outcome, open_loop=is_open))

    def report_status(
        self,
        now_s: float,
        state: RobotState,
        there: BaseState,
        gesture: Gesture | None,
        lights: tuple[Color, Color] | None,
        bad_messages: int,
        counters: Mapping[str, int],
    ) -> None:
        """Report the status where it has changed, and every so often.

        ``lights`` are those of the score that is played, None where none is.
        """
        every_s = STATUS_IDLE_S if gesture is None else STATUS_MOVING_S
        due = self._reported_s is None or not 0 <= now_s - self._reported_s < every_s
        if not due and state == self._reported:
            return
        self._reported_s, self._reported = now_s, state
        name = None if gesture is None else gesture.name
        volts = there.sensors.battery_v
        battery = (None, False) if volts is None else (battery_share(volts), volts < BATTERY_WARN_V)
        self.report(
            status_report(self._base, *state, name, there, battery, bad_messages, counters)
            | {
                "lights": list(lights or LIGHTS[self._indication or Indication.WAITING]),
                "mood": "calm" if gesture is None else gesture.score.mood,
            }
        )

    def show(self, state: RobotState, *, is_quiet: bool) -> None:
        """Show a state by the base's lights, and by a sound unless it is quiet."""
        match state:
            case "stopped", _:
                indication = Indication.STOPPED
            case "performing", _:
                indication = Indication.MOVING
            case "idle", "":
                indication = Indication.READY
            case _:
                indication = Indication.WAITING
        if indication is not self._indication:
            self._indication = indication
            self._base.show(
                indication,
                aloud=not is_quiet and indication in self._aloud,
            )
