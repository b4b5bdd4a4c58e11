"""Idle life: small motions between answers, by which a robot seems to be there.

A session's order allows them (``Cue.idles``) or does not. They begin only while the robot may act
and no answer can be due before they end, so that they never cost one; and they answer nothing:
when one begins follows from the session's seed, and none follows anything else at once. Time is a
parameter.
"""

from __future__ import annotations

import random

from robot.behavior.safety import ANNOUNCE_S
from robot.motion.gesture import Gesture
from robot.motion.gesture_variants import IDLE

# All ours: from one to the next at least this [s] and up to so much more; so long after anything
# else that moved or was decided; and what a late base takes beyond what a motion needs.
LEAST_S, SPREAD_S = 5.0, 9.0
PAUSE_S = 0.8
BASE_LATE_S = 0.8


def needed_s(gesture: Gesture, pace: float) -> float:
    """Return how long a motion is to be free of answers [s], its announcement included."""
    return ANNOUNCE_S + gesture.min_duration_s(pace) + BASE_LATE_S


class IdleLife:
    """Chooses which idle motion begins now, if any.

    Parameters
    ----------
    seed
        Of the session.
    """

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(f"{seed} idle")  # noqa: S311 (nothing here is a secret)
        self._due_s: float | None = None
        self._disturbed_s: float | None = None
        self._gesture = IDLE[0]

    def disturb(self, now_s: float) -> None:
        """Note that something else moves or was decided [s]."""
        self._disturbed_s = now_s

    def forbid(self) -> None:
        """Drop what was due: after a stop and an arming, too, the least time passes first."""
        self._due_s = None

    def next(self, now_s: float, free_s: float, pace: float) -> Gesture | None:
        """Return the motion that begins now; None for none.

        Parameters
        ----------
        now_s
            The time [s].
        free_s
            How long no answer can be due [s].
        pace
            The share of the limits at which it would move at most.
        """
        if self._due_s is None:
            others = [one for one in IDLE if one is not self._gesture]
            self._gesture = others[int(self._chance.random() * len(others))]
            self._due_s = now_s + LEAST_S + SPREAD_S * self._chance.random()
        was_disturbed = self._disturbed_s is not None and now_s - self._disturbed_s < PAUSE_S
        if now_s < self._due_s or was_disturbed or free_s < needed_s(self._gesture, pace):
            return None
        self._due_s = None
        return self._gesture
