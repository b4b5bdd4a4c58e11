"""Dead reckoning of a base by its wheels and its gyro."""

from __future__ import annotations

import math
from dataclasses import replace

from robot.motion.pose import HOME, advance
from robot.motion.twist import WHEELBASE_M, Twist

# A gyro that turns slower than this [rad/s] while both wheels stand still drifts: "a couple of
# degrees a minute at worst" (docs/reference/kobuki.md#odometry-and-gyro), 30 times less. A base
# that is turned by hand turns its wheels; one that is lifted turns faster.
DRIFT_RAD_S = math.radians(1.0)
WHEEL_STILL_M = 1e-9

# The drift counts as learnt after so much rest [s], of which the first part [s] is not looked at:
# wheels that creep stand still for a frame or two. What was learnt fades within a minute [s], for
# it wanders with the sensor's temperature. (All ours.)
LEARNT_S, COMING_TO_REST_S, FADES_S = 0.5, 0.2, 60.0
# One wheel may be so much larger than the other, as a share; with every way ahead, wheels and gyro
# then disagree a little more.
UNEQUAL = 0.025
GAP_S = 0.5  # a longer pause between two frames is none of rest: the base may have been off


class Odometry:
    """Integrates distances by the wheels and headings by the gyro, whose drift it learns at rest.

    Parameters
    ----------
    drift_rad_s
        How fast the gyro turns by itself, until a rest has shown it [rad/s].
    wheel_scale
        Distance by the wheels over the true one.

    Attributes
    ----------
    pose
        Pose from home.
    slip_rad
        Heading by the wheels minus heading by the gyro since home [rad]: a wheel that slips, a
        push, or a gyro that wanders.
    drift_rad_s
        How fast the gyro turns by itself, as far as is known [rad/s].
    """

    def __init__(self, drift_rad_s: float = 0.0, wheel_scale: float = 1.0) -> None:
        self._wheel_scale = wheel_scale
        self.drift_rad_s = drift_rad_s
        self._last: tuple[float, float, float, float] | None = None
        self._last_s = 0.0
        self._still_s = 0.0  # for how long the wheels have stood
        self._rest_s = self._rest_rad = 0.0  # what the gyro turned at rest, and in what time
        self.set_home()

    def set_home(self) -> None:
        """Make the present place home."""
        self.pose, self.slip_rad, self._rolled_m = HOME, 0.0, 0.0

    @property
    def doubt_rad(self) -> float:
        """How far wheels and gyro disagree about the heading since home [rad].

        What wheels of unequal size explain is left out.
        """
        explained_rad = UNEQUAL * abs(self._rolled_m) / WHEELBASE_M
        return max(abs(self.slip_rad) - explained_rad, 0.0)

    def add(
        self,
        left_m: float,
        right_m: float,
        heading_rad: float,
        turn_rad_s: float,
        at_s: float,
        aside_m: float = 0.0,
    ) -> None:
        """Add what wheels and gyro have measured since the last call.

        Parameters
        ----------
        left_m, right_m
            Distances rolled so far [m]; only differences between calls count.
        heading_rad
            Heading by the gyro [rad], full turns included; only differences count.
        turn_rad_s
            Turning rate by the gyro [rad/s].
        at_s
            When that was [s].
        aside_m
            What a holonomic base has moved to the left so far [m].
        """
        last, self._last = self._last, (left_m, right_m, heading_rad, aside_m)
        elapsed_s, self._last_s = max(0.0, at_s - self._last_s), at_s
        if last is None:
            return
        by_left_m, by_right_m, by_rad, by_aside_m = (
            now - then for now, then in zip(self._last, last, strict=True)
        )
        are_still = max(map(abs, (by_left_m, by_right_m, by_aside_m))) < WHEEL_STILL_M
        if are_still and abs(turn_rad_s) < DRIFT_RAD_S:
            self._learn_drift(by_rad, elapsed_s)
            by_rad = 0.0
        else:
            self._still_s = 0.0
            by_rad -= self.drift_rad_s * min(elapsed_s, GAP_S)
        by_wheels = Twist.of_wheels(by_left_m / self._wheel_scale, by_right_m / self._wheel_scale)
        self._rolled_m += by_wheels.v_m_s
        self.slip_rad += by_wheels.w_rad_s - by_rad
        by_all = replace(by_wheels, w_rad_s=by_rad, vy_m_s=by_aside_m / self._wheel_scale)
        self.pose = advance(self.pose, by_all, 1.0)

    def _learn_drift(self, by_rad: float, elapsed_s: float) -> None:
        """Add what the gyro turned while the wheels stood."""
        if elapsed_s > GAP_S:
            self._still_s = 0.0
            return
        self._still_s += elapsed_s
        if self._still_s < COMING_TO_REST_S:
            return
        fading = math.exp(-elapsed_s / FADES_S)
        self._rest_s = self._rest_s * fading + elapsed_s
        self._rest_rad = self._rest_rad * fading + by_rad
        if self._rest_s >= LEARNT_S:
            self.drift_rad_s = self._rest_rad / self._rest_s
