"""When a robot responds: how some steps compare with a threshold, by the rule of its cue.

The paper's rule (P 3.4.1), on the source's clock: windows of 5 s follow each other without a gap
from the first step on; a window's mean is *above* where it reaches the threshold. Two rules are
ours: streaks, so many steps in a row on one side of the threshold; and steps, the mean of so many.
Which pool answers: answer_choice.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.behavior.cue import Cue
from robot.wire.cue_limits import CueRule

MIN_STEPS = 2  # of a window; with fewer valid steps there is no decision
# A window above gets a gesture of full size from this mean performance on, where the strong words
# for the patient begin (rehab/training/feedback_bands.py); at the threshold one of this share (our
# choice).
FULL_PERFORMANCE = 1.1
MIN_STRENGTH = 0.5
SHORTEST_STEP_S = 0.7  # nobody who trains after a stroke takes steps of one leg faster (ours)

# Why no gesture followed a decision.
NO_GESTURE = "no_gesture"  # the order names none for it
LATE = "late"  # the step that ended the window came more than a window after it
PERFORMING = "performing"
RESTING = "resting"
OFF = "off"  # the order's intensity is 0
ONLY_INFORMS = "only_informs"  # the feedback judges nothing


@dataclass(frozen=True, slots=True)
class Decision:
    """The result of a window; ``at_s`` is the time of the step that ended it."""

    from_s: float
    until_s: float
    at_s: float
    steps: int
    mean: float
    threshold: float
    above: bool

    @property
    def is_late(self) -> bool:
        """Whether it ended more than a window ago, too late for a gesture."""
        return self.at_s - self.until_s > self.until_s - self.from_s

    @property
    def strength(self) -> float:
        """The share of the cue's intensity for its gesture, ``MIN_STRENGTH`` to 1.

        Above the threshold it grows with the mean performance; below it is 1.
        """
        if not self.above or self.mean >= FULL_PERFORMANCE:
            return 1.0
        grown = (self.mean - self.threshold) / (FULL_PERFORMANCE - self.threshold)
        return MIN_STRENGTH + (1 - MIN_STRENGTH) * grown


class WindowDecider:
    """Sorts steps into windows, streaks or groups, and decides when a gesture may start.

    Windows are counted from the first step: the one with the number k has the steps of which
    ``(time - first) / window_s`` lies in [k, k + 1). A window ends with the first step of a later
    one, since only steps carry the source's clock. A streak ends with its last step, and the next
    one begins after it; so does a group of steps.
    """

    def __init__(self, cue: Cue) -> None:
        self.cue = cue
        self.windows = 0  # those with a decision; streaks and groups count like windows
        self.activated = 0  # those above
        self._started_s: float | None = None  # when the last gesture started
        self.drop_window()

    @property
    def share(self) -> float | None:
        """The share of windows that were above; None before there was one."""
        return self.activated / self.windows if self.windows else None

    def drop_window(self) -> None:
        """Discard the open window, streak or group, since some of its steps are missing."""
        self._first_s: float | None = None
        self._window = 0
        self._steps, self._sum = 0, 0.0
        self._is_above = False  # the side of the open streak

    def set_cue(self, cue: Cue) -> None:
        """Use another cue, from the open window on."""
        ours = self.cue
        if (cue.rule, cue.count, cue.window_s) != (ours.rule, ours.count, ours.window_s):
            self.drop_window()
        self.cue = cue

    def add(self, time_s: float, performance: float) -> Decision | None:
        """Add a step, and return the decision about the window that it ended, or None.

        Parameters
        ----------
        time_s
            The source's clock [s]. One that is earlier than the open window starts over.
        performance
            Shown value over goal, finite.
        """
        if self._first_s is None:
            self._first_s = time_s
            if self._started_s is not None and self._started_s > time_s:
                self._started_s = time_s  # the clock was set back: how long ago it was is unknown
        if self.cue.rule != CueRule.WINDOWS:
            return self._add_to_group(time_s, performance)
        window = math.floor((time_s - self._first_s) / self.cue.window_s)
        if window < self._window:
            self.drop_window()
            self._first_s, window = time_s, 0
            if self._started_s is not None:
                self._started_s = time_s
        decision = self._decide(time_s) if window > self._window else None
        if window > self._window:
            self._window, self._steps, self._sum = window, 0, 0.0
        self._steps += 1
        self._sum += performance
        return decision

    def _add_to_group(self, time_s: float, performance: float) -> Decision | None:
        """Add a step to the open streak or group of steps, and return the decision at its end."""
        above = performance >= self.cue.threshold
        if self.cue.rule == CueRule.STREAKS and self._steps and above != self._is_above:
            self.drop_window()
        if self._first_s is None or time_s < self._first_s:
            self.drop_window()
            self._first_s = time_s
            if self._started_s is not None:
                self._started_s = min(self._started_s, time_s)
        self._is_above = above
        self._steps += 1
        self._sum += performance
        if self._steps < self.cue.count:
            return None
        mean = self._sum / self._steps
        # Each step of a streak is on its side; their mean may be rounded to the other one.
        above = above if self.cue.rule == CueRule.STREAKS else mean >= self.cue.threshold
        decision = self._conclude(self._first_s, time_s, time_s, above=above)
        self.drop_window()
        return decision

    def _decide(self, time_s: float) -> Decision | None:
        if self._first_s is None or self._steps < MIN_STEPS:
            return None
        from_s = self._first_s + self._window * self.cue.window_s
        above = self._sum / self._steps >= self.cue.threshold
        return self._conclude(from_s, from_s + self.cue.window_s, time_s, above=above)

    def _conclude(self, from_s: float, until_s: float, at_s: float, *, above: bool) -> Decision:
        self.windows += 1
        self.activated += above
        return Decision(
            from_s=from_s,
            until_s=until_s,
            at_s=at_s,
            steps=self._steps,
            mean=self._sum / self._steps,
            threshold=self.cue.threshold,
            above=above,
        )

    def blocking_reason(self, decision: Decision, *, performing: bool) -> str:
        """Return why no gesture may follow a decision now; empty where one may.

        Parameters
        ----------
        decision
            The window's result.
        performing
            Whether a gesture is running.
        """
        if self.cue.gesture(decision.above) is None:
            return NO_GESTURE
        if self.cue.only_informs:
            return ONLY_INFORMS
        if not self.cue.intensity:
            return OFF
        if decision.is_late:
            return LATE
        if performing:
            return PERFORMING
        if self._started_s is not None and decision.at_s - self._started_s < self.cue.rest_s:
            return RESTING
        return ""

    def free_s(self, time_s: float) -> float:
        """Return how long no decision can be due yet [s]; 0 where one may be at any moment.

        Parameters
        ----------
        time_s
            The source's clock now, as far as it is known [s].
        """
        if self.cue.rule != CueRule.WINDOWS:
            return (self.cue.count - self._steps) * SHORTEST_STEP_S
        if self._first_s is None:
            return self.cue.window_s
        until_s = self._first_s + (self._window + 1) * self.cue.window_s
        if self._steps < MIN_STEPS or time_s > until_s + self.cue.window_s:
            until_s = math.inf  # what ends it now decides nothing, or too late for an answer
        return max(until_s - time_s, 0.0)

    def mark_started(self, decision: Decision) -> None:
        """Store that a gesture answers this decision."""
        self._started_s = decision.at_s
