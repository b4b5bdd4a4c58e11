"""Dead reckoning of a base by its wheels and its gyro."""

from __future__ import annotations

import math

from robot.motion.pose import HOME, Pose

# A gyro that turns slower than this [rad/s] while both wheels stand still drifts: "a couple of
# degrees a minute at worst" (docs/reference/kobuki.md#odometry-and-gyro), 30 times less. A base
# that is turned by hand turns its wheels; one that is lifted turns faster.
DRIFT_RAD_S = math.radians(1.0)
WHEEL_STILL_M = 1e-9


class Odometry:
    """Integrates distances by the wheels and headings by the gyro.

    Parameters
    ----------
    wheelbase_m
        Distance between the wheels [m].

    Attributes
    ----------
    pose
        Pose from home.
    slip_rad
        Heading by the wheels minus heading by the gyro [rad]: a wheel that slips, or a push.
    """

    def __init__(self, wheelbase_m: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._last: tuple[float, float, float] | None = None
        self.set_home()

    def set_home(self) -> None:
        """Make the present place home."""
        self.pose, self.slip_rad = HOME, 0.0

    def add(self, left_m: float, right_m: float, heading_rad: float, turn_rad_s: float) -> None:
        """Add what wheels and gyro have measured since the last call.

        Parameters
        ----------
        left_m, right_m
            Distances rolled so far [m]; only differences between calls count.
        heading_rad
            Heading by the gyro [rad], full turns included; only differences count.
        turn_rad_s
            Turning rate by the gyro [rad/s].
        """
        last, self._last = self._last, (left_m, right_m, heading_rad)
        if last is None:
            return
        by_left_m, by_right_m, by_rad = (
            now - then for now, then in zip(self._last, last, strict=True)
        )
        are_still = max(abs(by_left_m), abs(by_right_m)) < WHEEL_STILL_M
        if are_still and abs(turn_rad_s) < DRIFT_RAD_S:
            by_rad = 0.0
        along_rad = self.pose.heading_rad + by_rad / 2
        by_m = (by_left_m + by_right_m) / 2
        self.slip_rad += (by_right_m - by_left_m) / self._wheelbase_m - by_rad
        self.pose = Pose(
            self.pose.x_m + by_m * math.cos(along_rad),
            self.pose.y_m + by_m * math.sin(along_rad),
            self.pose.heading_rad + by_rad,
        )
