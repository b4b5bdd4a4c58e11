"""A simulated base on a perfect floor: it follows every order, and its odometry is exact."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from robot.bases.base import Abilities, BaseState, GroundTruth, MobileBase
from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, ORDER_HOLDS_S, Limits
from robot.motion.pose import HOME, advance
from robot.motion.twist import STILL, Twist

WHEEL_LIMITS = Limits(v_m_s=CEILING_M_S, w_rad_s=CEILING_RAD_S)


class KinematicBase(MobileBase):
    """Moves by ``advance``, on a clock [s] that is a parameter."""

    name: ClassVar[str] = "kinematic"
    abilities = Abilities(simulated=True, moves=True)

    def __init__(self, monotonic: Callable[[], float]) -> None:
        self._monotonic = monotonic
        self._pose = HOME
        self._twist = STILL
        self._farthest_m = 0.0
        self._time_s = self._ordered_s = monotonic()

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; its speeds are clipped."""
        self._move()
        self._twist, self._ordered_s = WHEEL_LIMITS.clip(twist), self._time_s
        return self._twist

    def stop(self) -> None:
        """Stand still at once."""
        self.drive(STILL)

    def read(self) -> BaseState:
        """Return its state now."""
        self._move()
        return BaseState(self._pose, self._twist)

    def set_home(self) -> None:
        """Put it back to where it began, standing still."""
        self.stop()
        self._pose, self._farthest_m = HOME, 0.0

    def ground_truth(self) -> GroundTruth:
        """Return its pose, which its odometry knows exactly."""
        return GroundTruth(self.read().pose, self._farthest_m)

    def _move(self) -> None:
        """Advance its pose to the present, at most for as long as its last order held."""
        now_s = self._monotonic()
        held_until_s = self._ordered_s + ORDER_HOLDS_S
        moved_s = min(now_s, held_until_s) - self._time_s
        if moved_s > 0:
            self._pose = advance(self._pose, self._twist, moved_s)
            self._farthest_m = max(self._farthest_m, self._pose.distance_m(HOME))
        if now_s >= held_until_s:
            self._twist = STILL
        self._time_s = now_s
