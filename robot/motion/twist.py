"""Velocities of a base that drives and turns.

Right-handed, as in ROS (REP 103): x ahead, y to the left, turns counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity: ``v_m_s`` ahead [m/s] and ``w_rad_s`` counter-clockwise [rad/s]."""

    v_m_s: float = 0.0
    w_rad_s: float = 0.0

    @property
    def is_still(self) -> bool:
        """Whether both speeds are 0."""
        return self.v_m_s == 0 and self.w_rad_s == 0

    @property
    def is_finite(self) -> bool:
        """Whether both numbers are finite."""
        return math.isfinite(self.v_m_s) and math.isfinite(self.w_rad_s)


STILL = Twist()
