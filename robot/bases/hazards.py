"""Hazards on their way from a base's thread to whoever decides about them."""

from __future__ import annotations

import math

from robot.motion.twist import Twist

# Ordered to stand for this long [s], a base stands: dead time, motor lag and ramps are over. Wheels
# that move on [m/s] for a moment [s] are driven by somebody else.
SETTLED_S = 1.0
MOVES_M_S = 0.03
MOVES_FOR_S = 0.2

UNORDERED = "unordered_motion"
HALF_TRACK_M = 0.115  # of a Kobuki (docs/reference/kobuki.md#odometry-and-gyro)


def rim_speed_m_s(twist: Twist) -> float:
    """Return the speed of the faster wheel of a base as wide as a Kobuki [m/s]."""
    return abs(twist.v_m_s) + HALF_TRACK_M * abs(twist.w_rad_s)


class UnreadHazards:
    """Hazards that were detected since the last reading, however short.

    Who reads them keeps them until they are judged (``behavior.senses``).
    """

    def __init__(self) -> None:
        self._unread: set[str] = set()

    def add(self, *hazards: str) -> None:
        """Store that hazards were detected."""
        self._unread.update(hazards)

    def take(self) -> frozenset[str]:
        """Return those that nobody has read."""
        taken, self._unread = self._unread, set()
        return frozenset(taken)


class StillWatch:
    """Detects a motion that nobody ordered."""

    def __init__(self) -> None:
        self._ordered_s, self._still_s = -math.inf, math.inf

    def order_motion(self, now_s: float) -> None:
        """Store that motion was ordered."""
        self._ordered_s = now_s

    def update(self, speed_m_s: float, now_s: float) -> bool:
        """Store the speed of the faster wheel [m/s]; return whether nobody has ordered it."""
        if abs(speed_m_s) < MOVES_M_S or now_s - self._ordered_s < SETTLED_S:
            self._still_s = now_s
        self._still_s = min(self._still_s, now_s)
        return now_s - self._still_s >= MOVES_FOR_S
