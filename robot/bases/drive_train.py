"""Simulated drive trains: what lies between an order and the motion of the wheels."""

from __future__ import annotations

import math
from collections import deque

# An ordinary Kobuki's: what is reported of a TurtleBot 2 with firmware 1.2.0, and the middle of
# what is assumed of motors (docs/reference/kobuki.md#dead-time); stiction, drift and noise of
# the gyro are ours, within what users report (docs/reference/kobuki.md#what-users-report).
DEAD_TIME_S, LAG_S, STICTION_M_S = 0.2, 0.04, 0.008
DRIFT_DEG_MIN, GYRO_NOISE_DEG_S = 2.0, 0.1

# The wheels' controller lets a motor push with up to this force, at both wheels [N]: 1 N·m each on
# wheels of 35 mm (docs/reference/kobuki.md#twin). It takes a moment [s] to build up, as the
# controller's integral does (ours).
FORCE_MAX_N = 57.0
BUILD_UP_S = 0.3
# Rolling and its own inertia take this [N] and this mass [kg]: a TurtleBot 2 with plates
# (docs/reference/kobuki.md#twin); the rolling resistance is ours.
ROLLING_N = 1.5
MASS_KG = 6.0

SHORTEST_S = 0.001  # from less than that no acceleration is computed

# Speeds [m/s]: of the left and right wheel; of a holonomic base, of its left and right side, and to
# the left (``Twist.sides_m_s``).
Wheels = tuple[float, ...]


class DriveTrain:
    """Wheels that answer late, gradually, and not at all to the smallest orders.

    Parameters
    ----------
    dead_time_s, lag_s, stiction_m_s
        See the attributes.
    count
        How many: two, or three of a holonomic base.

    Attributes
    ----------
    dead_time_s
        From an order to the first motion [s].
    lag_s
        Time constant of the motors [s].
    stiction_m_s
        A wheel follows no order below this speed [m/s]: it stays, or comes to rest.
    held
        Share of its speed that something takes from it, 0 to 1: 1 is a foot in its way.
    wheels_m_s
        Speeds of the wheels now [m/s].
    force_n
        Force with which the motors push, beyond what holding a speed takes nothing of [N].
    """

    def __init__(
        self,
        dead_time_s: float = 0.0,
        lag_s: float = 0.0,
        stiction_m_s: float = 0.0,
        count: int = 2,
    ) -> None:
        self.dead_time_s, self.lag_s, self.stiction_m_s = dead_time_s, lag_s, stiction_m_s
        self.held = 0.0
        self.wheels_m_s: Wheels = (0.0,) * count
        self.force_n = 0.0
        self._orders: deque[tuple[float, Wheels]] = deque()  # when each arrives at the motors
        self._target = self._free = (
            self.wheels_m_s
        )  # as ordered, and as it would be if nothing held it
        self._resisted_s = 0.0

    @property
    def is_at_rest(self) -> bool:
        """Whether it stands and nothing is on its way to it."""
        return not (self._orders or any(self._target) or any(self._free))

    def order(self, wheels: Wheels, now_s: float) -> None:
        """Order speeds of the wheels, which the motors hear after the dead time.

        Parameters
        ----------
        wheels
            Their speeds [m/s].
        now_s
            The time [s].
        """
        self._orders.append((now_s + self.dead_time_s, wheels))

    def next_change_s(self) -> float:
        """Return when the next order arrives at the motors [s]; infinity for never."""
        return self._orders[0][0] if self._orders else math.inf

    def step(self, now_s: float, elapsed_s: float) -> Wheels:
        """Return the speeds of the wheels over a span that begins now.

        Parameters
        ----------
        now_s
            When it begins [s].
        elapsed_s
            How long it is [s].
        """
        while self._orders and self._orders[0][0] <= now_s + 1e-9:
            self._target = self._orders.popleft()[1]
        share = 1.0 if self.lag_s <= 0 else 1 - math.exp(-elapsed_s / self.lag_s)
        speeds = zip(self._free, self._target, strict=True)
        self._free = tuple(self._move(speed, target, share) for speed, target in speeds)
        was, loses = self.wheels_m_s, 1 - self.held
        self.wheels_m_s = tuple(speed * loses for speed in self._free)
        self._push(was, elapsed_s)
        return self.wheels_m_s

    def _move(self, speed: float, target: float, share: float) -> float:
        if abs(target) < self.stiction_m_s:
            target = 0.0
        speed += (target - speed) * share
        return target if abs(target - speed) < 1e-4 else speed

    def _push(self, was: Wheels, elapsed_s: float) -> None:
        """Compute the force: rolling, speeding up, and pushing against what holds it."""
        if elapsed_s < SHORTEST_S:
            return
        missed = max(abs(t - s) for t, s in zip(self._target, self.wheels_m_s, strict=True))
        is_held = self.held > 0 and missed > self.stiction_m_s
        self._resisted_s = self._resisted_s + elapsed_s if is_held else 0.0
        rolling_n = ROLLING_N if any(self.wheels_m_s) else 0.0
        left, right, *aside = (b - a for a, b in zip(was, self.wheels_m_s, strict=True))
        inertia_n = MASS_KG * math.hypot((left + right) / 2, *aside) / elapsed_s
        pushing_n = self.held * FORCE_MAX_N * min(self._resisted_s / BUILD_UP_S, 1.0)
        self.force_n = min(rolling_n + inertia_n + pushing_n, FORCE_MAX_N)
