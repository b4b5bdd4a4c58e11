"""A robot on a virtual clock: an hour of a session in a second, by the code of live robots.

For recordings that are scored without pages. The clock is the source's, as far as it runs forward.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from robot.bases import BASES
from robot.behavior.control_loop import control_loop
from robot.behavior.performer import Performer
from robot.motion.limits import TICK_S

# Simulated bases that run on any clock.
SIMULATED_BASES = [
    name
    for name, base in BASES.items()
    if base.abilities.simulated and not base.abilities.real_time
]


class Simulation:
    """Runs a whole session, one fresh step after the other.

    Parameters
    ----------
    base
        One of ``SIMULATED_BASES``.
    cue
        The session's order to its robot, as the server sends it.

    Attributes
    ----------
    decisions
        The reports of its decisions, as a live robot sends them.
    gestures
        Its gestures: name, start and end on the virtual clock [s], outcome.

    Raises ValueError for a base that is not simulated, and for an invalid cue.
    """

    def __init__(self, base: str, cue: Mapping[str, Any]) -> None:
        self._now_s = 0.0
        self._source_s: float | None = None
        robot = BASES[base](lambda: self._now_s)
        if not robot.abilities.simulated or robot.abilities.real_time:
            raise ValueError(f"The base {base} is no simulation that keeps to a clock of ours.")
        self._performer = Performer(robot)
        self._handle({"type": "welcome", "session": 0, "state": "running", "cue": cue})
        if not self._performer.is_linked:
            raise ValueError(self._performer.last_bad_message)
        self.decisions: list[dict[str, Any]] = []
        self.gestures: list[dict[str, Any]] = []

    @property
    def share(self) -> float | None:
        """The share of windows above the threshold."""
        return self._performer.decider.share

    def walk(self, steps: Iterable[tuple[float, float]]) -> None:
        """Add steps (source time [s], performance), and play the last gesture to its end."""
        for time_s, performance in steps:
            if self._source_s is None:
                self._now_s = self._source_s = time_s
            self._advance(max(0.0, time_s - self._source_s))
            self._source_s = time_s
            self._handle({"type": "step", "time_s": time_s, "performance": performance})
            self._collect()
        while self._performer.body.player.is_busy:
            self._advance(TICK_S)

    def _handle(self, message: Mapping[str, Any]) -> None:
        self._performer.handle(message, self._now_s)

    def _advance(self, span_s: float) -> None:
        """Advance the clock by a span [s]; in one step while nothing moves."""
        until_s = self._now_s + span_s
        player = self._performer.body.player
        for pause_s in control_loop(
            self._performer,
            lambda: self._now_s,
            lambda: not player.is_busy or self._now_s >= until_s,
        ):
            self._collect()
            self._now_s = min(self._now_s + pause_s, until_s)
            self._handle({"type": "heartbeat"})
        self._collect()
        if self._now_s < until_s:
            self._now_s = until_s
            self._handle({"type": "heartbeat"})
            for _ in range(2):  # the first comes late, as after a hang; the next one in time
                self._performer.tick(until_s)

    def _collect(self) -> None:
        """Store the robot's new decisions and gestures."""
        reports = self._performer.reports
        while reports:
            report = reports.popleft()
            match report["kind"], report.get("phase"):
                case "decision", _:
                    self.decisions.append(report)
                case "gesture", "started":
                    self.gestures.append({"name": report["name"], "started_s": self._now_s})
                case "gesture", "ended":
                    self.gestures[-1] |= {"ended_s": self._now_s, "outcome": report["outcome"]}
