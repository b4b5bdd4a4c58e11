"""When a robot answers: the mean performance of five seconds of walking against a threshold.

The paper's rule (P 3.4.1), on the source's clock: windows of 5 s follow each other without a gap
from the first step on; a window's mean is *above* where it reaches the threshold. Here are the
session's order to its robot, the windows, and when a gesture may start.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

MIN_STEPS = 2  # fewer valid steps in a window say nothing
# What the server stores at most (seconds since 1970 pass, milliseconds do not), and performances
# that no step has.
TIME_MAX_S = 1e10
PERFORMANCE_MAX = 1000.0
NAME_MAX = 64
LEAST_INTENSITY = 0.1
# A cue of this intensity or less is performed quietly: without sounds, and at this share of every
# speed and acceleration, so that half as far takes as long (our choice).
QUIET = 0.5
QUIET_PACE = 0.5

# A window above is answered in full from this mean performance on, where the strong words for the
# patient begin; at the threshold with this share of it (our choice).
FULL_PERFORMANCE = 1.1
FAINT = 0.5

GESTURES_MAX = 8  # that come along with a cue

# Why no gesture followed a decision.
NO_GESTURE = "no_gesture"  # the order names none for it
LATE = "late"  # the step that ended the window came more than a window after it
PERFORMING = "performing"
RESTING = "resting"
OFF = "off"  # the order's intensity is 0


class BadMessage(ValueError):
    """A message that is not the protocol; it is counted and has no effect."""


def read_number(message: Mapping[str, Any], name: str, low: float, high: float) -> float:
    """Read a number within bounds. Raises BadMessage."""
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise BadMessage(f'"{name}" is a number from {low:g} to {high:g}.')
    return float(value)


@dataclass(frozen=True, slots=True)
class Cue:
    """A session's order to its robot.

    Parameters
    ----------
    above, below
        The gesture after a window above or below the threshold; None for none.
    threshold
        Mean performance that a window has to reach; 1 is the goal.
    window_s, rest_s
        Length of a window, and time from the start of one gesture to the start of the next, both
        on the source's clock [s]: so what a robot does follows from the log, without chance.
    intensity
        Share of a gesture's size, 0.1 to 1; 0 for no gesture at all.
    gestures
        Gestures that somebody composed, as they traveled: not read yet.
    """

    above: str | None = None
    below: str | None = None
    threshold: float = 0.9
    window_s: float = 5.0
    rest_s: float = 5.0
    intensity: float = 1.0
    gestures: tuple[Any, ...] = ()

    @classmethod
    def read(cls, cue: Any) -> Cue:
        """Read what the server sends. Raises BadMessage."""
        if not isinstance(cue, dict):
            raise BadMessage('"cue" is an object.')
        intensity = read_number(cue, "intensity", 0.0, 1.0)
        if 0 < intensity < LEAST_INTENSITY:
            raise BadMessage(f'"intensity" is 0, or a number from {LEAST_INTENSITY:g} to 1.')
        gestures = cue.get("gestures", [])
        if not isinstance(gestures, list) or len(gestures) > GESTURES_MAX:
            raise BadMessage(f'"gestures" is a list of up to {GESTURES_MAX}.')
        return cls(
            above=_read_gesture(cue, "above"),
            below=_read_gesture(cue, "below"),
            threshold=read_number(cue, "threshold", 0.0, 10.0),
            window_s=read_number(cue, "window_s", 1.0, 600.0),
            rest_s=read_number(cue, "rest_s", 0.0, 3600.0),
            intensity=intensity,
            gestures=tuple(gestures),
        )

    @property
    def is_quiet(self) -> bool:
        """Whether it is to be performed without sounds, and slowly."""
        return self.intensity <= QUIET

    def gesture(self, above: bool) -> str | None:
        """Give the gesture after a decision."""
        return self.above if above else self.below


def _read_gesture(cue: Mapping[str, Any], name: str) -> str | None:
    gesture = cue.get(name)
    if gesture is not None and not (isinstance(gesture, str) and 0 < len(gesture) <= NAME_MAX):
        raise BadMessage(f'"{name}" is the name of a gesture, or null.')
    return gesture


@dataclass(frozen=True, slots=True)
class Decision:
    """What a window came to; ``at_s`` is the time of the step that ended it."""

    from_s: float
    until_s: float
    at_s: float
    steps: int
    mean: float
    threshold: float
    above: bool

    @property
    def is_late(self) -> bool:
        """Whether it is of so long ago that nobody may answer it any more."""
        return self.at_s - self.until_s > self.until_s - self.from_s

    @property
    def vigor(self) -> float:
        """The share of the cue's intensity that answers it, ``FAINT`` to 1.

        Above the threshold it grows with the mean performance; a window below never makes it grow.
        """
        if not self.above or self.mean >= FULL_PERFORMANCE:
            return 1.0
        grown = (self.mean - self.threshold) / (FULL_PERFORMANCE - self.threshold)
        return FAINT + (1 - FAINT) * grown


class Activation:
    """Sorts steps into windows, and says when a gesture may start.

    Windows are counted from the first step: the one with the number k has the steps of which
    ``(time - first) / window_s`` lies in [k, k + 1). A window ends with the first step of a later
    one, for the source's clock is told by steps alone.
    """

    def __init__(self, cue: Cue) -> None:
        self.cue = cue
        self.windows = 0  # those with a decision
        self.activated = 0  # those above
        self._started_s: float | None = None  # when the last gesture started
        self.forget()

    @property
    def share(self) -> float | None:
        """The share of windows that were above; None before there was one."""
        return self.activated / self.windows if self.windows else None

    def forget(self) -> None:
        """Drop the window that is open: some of its steps are missing."""
        self._first_s: float | None = None
        self._window = 0
        self._steps, self._sum = 0, 0.0

    def follow(self, cue: Cue) -> None:
        """Take another order, from the window on that is open."""
        if cue.window_s != self.cue.window_s:
            self.forget()
        self.cue = cue

    def add(self, time_s: float, performance: float) -> Decision | None:
        """Add a step; give the decision about the window that it ended, if it did.

        Parameters
        ----------
        time_s
            The source's clock [s]. One that is earlier than the open window begins anew.
        performance
            Shown value over goal, finite.
        """
        if self._first_s is None:
            self._first_s = time_s
            if self._started_s is not None and self._started_s > time_s:
                self._started_s = time_s  # set back meanwhile: nobody knows how long ago it was
        window = math.floor((time_s - self._first_s) / self.cue.window_s)
        if window < self._window:
            self.forget()
            self._first_s, window = time_s, 0
            if self._started_s is not None:
                self._started_s = time_s
        decision = self._decide(time_s) if window > self._window else None
        if window > self._window:
            self._window, self._steps, self._sum = window, 0, 0.0
        self._steps += 1
        self._sum += performance
        return decision

    def _decide(self, time_s: float) -> Decision | None:
        if self._first_s is None or self._steps < MIN_STEPS:
            return None
        from_s = self._first_s + self._window * self.cue.window_s
        until_s = from_s + self.cue.window_s
        mean = self._sum / self._steps
        above = mean >= self.cue.threshold
        self.windows += 1
        self.activated += above
        return Decision(
            from_s=from_s,
            until_s=until_s,
            at_s=time_s,
            steps=self._steps,
            mean=mean,
            threshold=self.cue.threshold,
            above=above,
        )

    def obstacle(self, decision: Decision, *, performing: bool) -> str:
        """Say why no gesture may follow a decision now; nothing where one may.

        Parameters
        ----------
        decision
            What the window came to.
        performing
            Whether a gesture is running.
        """
        if self.cue.gesture(decision.above) is None:
            return NO_GESTURE
        if not self.cue.intensity:
            return OFF
        if decision.is_late:
            return LATE
        if performing:
            return PERFORMING
        if self._started_s is not None and decision.at_s - self._started_s < self.cue.rest_s:
            return RESTING
        return ""

    def started(self, decision: Decision) -> None:
        """Note that a gesture answers this decision."""
        self._started_s = decision.at_s
