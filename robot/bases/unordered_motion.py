"""Detects a motion of a base that was not ordered."""

from __future__ import annotations

import math

# Ordered to stand for this long [s], a base stands: dead time, motor lag and ramps are over. Wheels
# that move on [m/s] for a moment [s] are driven by someone or something else. (All ours.)
SETTLED_S = 1.0
MOVES_M_S = 0.03
MOVES_FOR_S = 0.2

UNORDERED = "unordered_motion"  # the hazard's code


class UnorderedMotion:
    """Detects wheels that turn although the base was last ordered to stand still."""

    def __init__(self) -> None:
        self._ordered_s, self._still_s = -math.inf, math.inf

    def order_motion(self, now_s: float) -> None:
        """Store that motion was ordered."""
        self._ordered_s = now_s

    def update(self, speed_m_s: float, now_s: float) -> bool:
        """Store how fast the base moves, and return whether that was not ordered.

        Parameters
        ----------
        speed_m_s
            Speed of the faster wheel [m/s].
        now_s
            The time [s].
        """
        if abs(speed_m_s) < MOVES_M_S or now_s - self._ordered_s < SETTLED_S:
            self._still_s = now_s
        self._still_s = min(self._still_s, now_s)
        return now_s - self._still_s >= MOVES_FOR_S
