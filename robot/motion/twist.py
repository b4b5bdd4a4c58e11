"""Velocities of a base that drives and turns, sideways too, and of its two wheels.

Right-handed, as in ROS (REP 103): x ahead, y to the left, turns counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

# Between the wheels of a Kobuki [m] (docs/reference/kobuki.md#odometry-and-gyro). Where a base's
# own is unknown, this one weighs turns against ways.
WHEELBASE_M = 0.23


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity: ahead and to the left [m/s], and counter-clockwise [rad/s].

    Only a holonomic base has one to the left, ``vy_m_s``; for every other it is an error.
    """

    v_m_s: float = 0.0
    w_rad_s: float = 0.0
    vy_m_s: float = 0.0

    @classmethod
    def of_wheels(cls, left_m_s: float, right_m_s: float) -> Self:
        """Return the twist of two wheels.

        Parameters
        ----------
        left_m_s, right_m_s
            Their speeds [m/s]; distances [m] give the distance ahead [m] and the turn [rad].
        """
        return cls((left_m_s + right_m_s) / 2, (right_m_s - left_m_s) / WHEELBASE_M)

    @property
    def wheels_m_s(self) -> tuple[float, float]:
        """Speeds of the left and the right wheel [m/s].

        Raises ValueError for a velocity that two wheels cannot have: one to the left.
        """
        if self.vy_m_s:
            raise ValueError("Two wheels do not roll sideways: order it of a holonomic base.")
        left_m_s, right_m_s, _ = self.sides_m_s
        return left_m_s, right_m_s

    @property
    def sides_m_s(self) -> tuple[float, float, float]:
        """Speeds ahead of its left and right side, and to the left [m/s].

        The sides are half of ``WHEELBASE_M`` from its middle: on two wheels, where these are.
        """
        turning_m_s = self.w_rad_s * WHEELBASE_M / 2
        return self.v_m_s - turning_m_s, self.v_m_s + turning_m_s, self.vy_m_s

    @property
    def speed_m_s(self) -> float:
        """How fast its middle moves, whichever way [m/s]."""
        return math.hypot(self.v_m_s, self.vy_m_s)

    @property
    def fastest_wheel_m_s(self) -> float:
        """Speed of the faster wheel, whichever way it turns [m/s].

        Of a base without such wheels: of what is as far from its middle.
        """
        return self.speed_m_s + abs(self.w_rad_s) * WHEELBASE_M / 2

    @property
    def is_still(self) -> bool:
        """Whether all speeds are 0."""
        return self.v_m_s == 0 and self.w_rad_s == 0 and self.vy_m_s == 0

    @property
    def is_finite(self) -> bool:
        """Whether all numbers are finite."""
        return all(map(math.isfinite, (self.v_m_s, self.w_rad_s, self.vy_m_s)))


STILL = Twist()
