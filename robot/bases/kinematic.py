"""A simulated base on an even floor: late, gradual, its gyro drifting, as real ones are."""

from __future__ import annotations

import math
import random
from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

from robot.bases.base import Abilities, BaseState, GroundTruth, MobileBase, SensorState
from robot.bases.drive_train import (
    DEAD_TIME_S,
    DRIFT_DEG_MIN,
    GYRO_NOISE_DEG_S,
    LAG_S,
    STICTION_M_S,
    DriveTrain,
)
from robot.bases.kobuki_protocol.wheels import TICK_M
from robot.bases.odometry import Odometry
from robot.motion.base_response import MOST_STICTION_M_S, Response
from robot.motion.limits import ORDER_HOLDS_S, TICK_S, WHEEL_LIMITS
from robot.motion.pose import HOME, advance
from robot.motion.twist import STILL, Twist

STEP_S = TICK_S / 2
GYRO_DIGIT_RAD = math.radians(0.01)


@dataclass(frozen=True, slots=True)
class Imperfections:
    """How a simulated base differs from an ideal one. The defaults are an ordinary Kobuki's.

    Parameters
    ----------
    dead_time_s, lag_s, stiction_m_s
        See ``DriveTrain``.
    has_noise
        Whether encoders and gyro have digits, and the gyro noise.
    left_scale, right_scale
        Size of the wheels over what odometry assumes.
    drift_deg_min
        How far the gyro turns by itself [°/min].
    held
        Share of its speed that something takes from it.
    """

    dead_time_s: float = DEAD_TIME_S
    lag_s: float = LAG_S
    stiction_m_s: float = STICTION_M_S
    has_noise: bool = True
    left_scale: float = 1.0
    right_scale: float = 1.0
    drift_deg_min: float = DRIFT_DEG_MIN
    held: float = 0.0


ORDINARY = Imperfections()
IDEAL = Imperfections(0.0, 0.0, 0.0, has_noise=False, drift_deg_min=0.0)


class KinematicBase(MobileBase):
    """Moves by ``advance``, on a clock [s] that is a parameter. All its runs draw the same noise.

    Parameters
    ----------
    monotonic
        The clock [s].
    faults
        How it differs from an ideal base.
    """

    name: ClassVar[str] = "kinematic"
    abilities = Abilities(simulated=True, moves=True)

    def __init__(self, monotonic: Callable[[], float], faults: Imperfections = ORDINARY) -> None:
        self._monotonic, self._faults = monotonic, faults
        self._drive_train = DriveTrain(faults.dead_time_s, faults.lag_s, faults.stiction_m_s, 3)
        self.held = faults.held
        self.response = Response(
            faults.dead_time_s,
            faults.lag_s,
            stiction_m_s=min(faults.stiction_m_s, MOST_STICTION_M_S),
        )
        self._odometry = Odometry()
        self._chance = random.Random(1)  # noqa: S311 (nothing here is a secret)
        self._truth, self._farthest_m = HOME, 0.0
        self._rolled_m, self._turned_rad = [0.0, 0.0, 0.0], 0.0  # as its sensors count
        self._turn_rad_s, self._twist, self._drives = 0.0, STILL, False
        self._time_s = self._ordered_s = monotonic()
        self._sample()

    @classmethod
    def add_arguments(cls, group: ArgumentParser | _ArgumentGroup) -> None:
        """Add the option of a base that moves sideways."""
        group.add_argument(
            "--holonomic", action="store_true", help="it moves sideways, too, as a Quori does"
        )

    def configure(self, options: Namespace) -> None:
        """Apply the options."""
        super().configure(options)
        self.abilities = replace(self.abilities, holonomic=getattr(options, "holonomic", False))

    @property
    def held(self) -> float:
        """Share of its speed that something takes from it, 0 to 1."""
        return self._drive_train.held

    @held.setter
    def held(self, share: float) -> None:
        self._drive_train.held = share

    def calibrate(self, response: Response) -> None:
        """Apply what was measured of its motion."""
        super().calibrate(response)
        self._odometry = Odometry(response.gyro_bias_rad_s, response.wheel_scale)
        self._sample()

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; its speeds are clipped."""
        self.abilities.check(twist)
        self._move()
        ordered, self._ordered_s = WHEEL_LIMITS.clip(twist), self._time_s
        self._order(ordered)
        return ordered

    def stop(self) -> None:
        """Stand still as soon as it can."""
        self.drive(STILL)

    def read(self) -> BaseState:
        """Return its state now."""
        self._move()
        self._sample()
        sensors = SensorState(
            slip_rad=self._odometry.slip_rad,
            doubt_rad=self._odometry.doubt_rad,
            drift_rad_s=self._odometry.drift_rad_s,
            push_n=self._drive_train.force_n,
        )
        return BaseState(self._odometry.pose, self._twist, sensors)

    def set_home(self) -> None:
        """Put it back to where it began, standing still."""
        self._move()
        train = self._drive_train
        self._drive_train = DriveTrain(train.dead_time_s, train.lag_s, train.stiction_m_s, 3)
        self._drive_train.held = train.held
        self._order(STILL)
        self._sample()
        self._odometry.set_home()
        self._truth, self._farthest_m = HOME, 0.0

    def ground_truth(self) -> GroundTruth:
        """Return its true pose."""
        self._move()
        return GroundTruth(self._truth, self._farthest_m)

    def _order(self, twist: Twist) -> None:
        self._drive_train.order(twist.sides_m_s, self._time_s)
        self._drives = not twist.is_still
        self._roll(0.0)  # without a dead time it counts at once

    def _move(self) -> None:
        """Move it up to the present; an order holds for ``ORDER_HOLDS_S``."""
        now_s, train = self._monotonic(), self._drive_train
        while True:
            holds_until_s = self._ordered_s + ORDER_HOLDS_S if self._drives else math.inf
            if self._time_s >= holds_until_s:
                self._order(STILL)
                continue
            if self._time_s >= now_s:
                break
            until_s = now_s  # of a base at rest: an hour takes no time
            if not train.is_at_rest:
                until_s = min(now_s, self._time_s + STEP_S, train.next_change_s(), holds_until_s)
            self._roll(until_s - self._time_s)
            self._time_s = until_s
            if self._time_s - self._sampled_s >= TICK_S:
                self._sample()
        self._time_s = now_s

    def _roll(self, span_s: float) -> None:
        """Roll for a span, true and as its sensors see it."""
        faults = self._faults
        left_m_s, right_m_s, aside_m_s = self._drive_train.step(self._time_s, span_s)
        self._twist = replace(Twist.of_wheels(left_m_s, right_m_s), vy_m_s=aside_m_s)
        true = Twist.of_wheels(left_m_s * faults.left_scale, right_m_s * faults.right_scale)
        true = replace(true, vy_m_s=aside_m_s * (faults.left_scale + faults.right_scale) / 2)
        self._truth = advance(self._truth, true, span_s)
        self._farthest_m = max(self._farthest_m, self._truth.distance_m(HOME))
        for wheel, speed_m_s in enumerate((left_m_s, right_m_s, aside_m_s)):
            self._rolled_m[wheel] += speed_m_s * span_s
        drift_rad_s = math.radians(faults.drift_deg_min / 60)
        self._turned_rad += (true.w_rad_s + drift_rad_s) * span_s
        self._turn_rad_s = true.w_rad_s + drift_rad_s

    def _sample(self) -> None:
        """Read wheels and gyro into the odometry."""
        left_m, right_m, aside_m = self._rolled_m
        turned_rad, turn_rad_s = self._turned_rad, self._turn_rad_s
        if self._faults.has_noise:
            left_m, right_m, aside_m = (TICK_M * round(m / TICK_M) for m in self._rolled_m)
            turned_rad = GYRO_DIGIT_RAD * round(turned_rad / GYRO_DIGIT_RAD)
            turn_rad_s += self._chance.gauss(0.0, math.radians(GYRO_NOISE_DEG_S))
        self._odometry.add(left_m, right_m, turned_rad, turn_rad_s, self._time_s, aside_m)
        self._sampled_s = self._time_s
