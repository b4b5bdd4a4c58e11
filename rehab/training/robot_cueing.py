"""What a robot's gestures answer, and how often: the part of a cue that the PT sets.

Its limits are those of the wire, so that a robot accepts what a plan may hold, and nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rehab.training.measures import InvalidSetting
from robot.wire.cue_limits import (
    COUNT_MAX,
    REST_MAX_S,
    THRESHOLD_MAX,
    WINDOW_MAX_S,
    WINDOW_MIN_S,
    CueRule,
)

# The paper's default (P 3.4.1): the robot responds to windows of at least 90 % of the goal.
DEFAULT_ACTIVATION_THRESHOLD = 0.90


def check_activation_threshold(threshold: float) -> float:
    """Return the threshold as a float. Raises InvalidSetting outside (0, 2]."""
    if not 0 < threshold <= THRESHOLD_MAX:
        raise InvalidSetting(
            "The robot acts from more than 0 and up to 200 % of the goal (0.9 for 90 %)."
        )
    return float(threshold)


def check_cue_rule(rule: object) -> CueRule:
    """Return the rule of that name. Raises InvalidSetting, naming the known ones."""
    try:
        return CueRule(rule)  # type: ignore[arg-type]  # any object may be looked up
    except ValueError:
        raise InvalidSetting("A robot answers one of: {known}.", known=", ".join(CueRule)) from None


@dataclass(frozen=True, slots=True)
class CueTiming:
    """When a robot decides, and how long it rests.

    Attributes
    ----------
    rule
        What a gesture answers.
    window_s
        ``windows``: length of a window, by the source's clock [s].
    count
        ``streaks``: steps in a row; ``steps``: steps whose mean performance is answered.
    rest_s
        Least time from the start of one gesture to the start of the next [s].

    Raises
    ------
    InvalidSetting
        For values out of bounds.
    """

    rule: CueRule = CueRule.WINDOWS
    window_s: float = 5.0
    count: int = 5
    rest_s: float = 5.0

    def __post_init__(self) -> None:
        if not WINDOW_MIN_S <= self.window_s <= WINDOW_MAX_S:
            raise InvalidSetting(
                "A robot's window lasts {least:g} to {most:g} seconds (5 in the paper).",
                least=WINDOW_MIN_S,
                most=WINDOW_MAX_S,
            )
        if not (math.isfinite(self.rest_s) and 0 <= self.rest_s <= REST_MAX_S):
            raise InvalidSetting("A robot rests 0 to {most:g} seconds.", most=REST_MAX_S)
        if not 1 <= self.count <= COUNT_MAX:
            raise InvalidSetting("A robot answers 1 to {most} steps.", most=COUNT_MAX)
