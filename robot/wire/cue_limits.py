"""What a cue asks of a robot: its limits, which plans keep to, and what it is by default."""

from __future__ import annotations

from enum import StrEnum

from robot.marking import gettext_noop

THRESHOLD_MAX = 2.0  # share of the goal; it lies above 0
WINDOW_MIN_S, WINDOW_MAX_S = 2.0, 60.0  # two steps at least, and still an answer to something
REST_MAX_S = 600.0
COUNT_MAX = 100
SEED_MAX = 2**31 - 1

# The paper's (P 3.4.1), but for the count of steps, which is ours.
DEFAULT_THRESHOLD = 0.9
DEFAULT_WINDOW_S = DEFAULT_REST_S = 5.0
DEFAULT_COUNT = 5

VARIED = "varied"  # in place of a gesture: one of a pool that follows from the walking


class CueRule(StrEnum):
    """What a gesture answers."""

    WINDOWS = gettext_noop("windows")  # the mean performance of some seconds
    STREAKS = gettext_noop("streaks")  # n steps in a row on one side of the threshold
    STEPS = gettext_noop("steps")  # the mean performance of each n steps
