"""How a base answers its orders: late, by a dead time and a lag, which are measured."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

from robot.motion.pose import Pose, advance
from robot.motion.twist import STILL, Twist

# No base is waited for longer than this [s]: twice the worst that is reported
# (docs/reference/kobuki.md#dead-time).
LONGEST_DELAY_S = 0.6


@dataclass(frozen=True, slots=True)
class Response:
    """How a base answers, and how its sensors err.

    Parameters
    ----------
    dead_time_s
        From an order to the first motion that its odometry reports [s].
    lag_s
        Time constant with which its wheels then approach the speed that was ordered [s].
    wheel_scale
        Distance by its wheels over the true one.
    gyro_bias_rad_s
        How fast its gyro turns at rest [rad/s].

    The defaults are for a base that nobody has measured yet: the middle of what is reported
    (docs/reference/kobuki.md#dead-time). ``python -m robot calibrate`` measures one.
    """

    dead_time_s: float = 0.12
    lag_s: float = 0.04
    wheel_scale: float = 1.0
    gyro_bias_rad_s: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.dead_time_s, self.lag_s, self.wheel_scale, self.gyro_bias_rad_s)
        if not all(map(math.isfinite, numbers)):
            raise ValueError("A base's response has finite numbers.")
        if min(self.dead_time_s, self.lag_s) < 0 or self.delay_s > LONGEST_DELAY_S:
            raise ValueError(f"Dead time and lag are 0 or more, together {LONGEST_DELAY_S:g} s.")
        if not 0.8 <= self.wheel_scale <= 1.2:
            raise ValueError("A wheel scale lies between 0.8 and 1.2.")

    @property
    def delay_s(self) -> float:
        """How late the base is, all in all [s]: a ramp follows one of ours by dead time and lag."""
        return self.dead_time_s + self.lag_s


AT_ONCE = Response(dead_time_s=0.0, lag_s=0.0)


class OrdersInFlight:
    """The orders that a base has not answered yet.

    Attributes
    ----------
    delay_s
        How late it answers [s].
    """

    def __init__(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self._orders: deque[tuple[float, Twist]] = deque([(-math.inf, STILL)])

    def add(self, twist: Twist, now_s: float) -> None:
        """Store what was ordered now; it holds until the next order."""
        while self._orders and self._orders[-1][0] >= now_s:  # the same time again, or a clock back
            self._orders.pop()
        self._orders.append((now_s, twist))
        # One order from before the longest delay is kept: it is the one that is answered then.
        while len(self._orders) > 1 and self._orders[1][0] <= now_s - LONGEST_DELAY_S:
            self._orders.popleft()

    def answered(self, now_s: float) -> Twist:
        """Return the order that the base should follow now."""
        answered = STILL
        for at_s, twist in self._orders:
            if at_s > now_s - self.delay_s:
                break
            answered = twist
        return answered

    def predict(self, pose: Pose, now_s: float) -> Pose:
        """Return where the base will be once it has answered all orders up to now.

        Parameters
        ----------
        pose
            Where its odometry says that it is.
        now_s
            The time [s].
        """
        ends = [*self._orders, (now_s, STILL)]
        for (from_s, twist), (until_s, _) in pairwise(ends):
            span_s = min(until_s, now_s) - max(from_s, now_s - self.delay_s)
            if span_s > 0 and not twist.is_still:
                pose = advance(pose, twist, span_s)
        return pose
