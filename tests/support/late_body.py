"""A body that follows its driver late and gradually, with noise, on a clock that is told."""

import math
import random
from collections import deque

STEP_S = 0.005


class LateBody:
    """Where a base is, in truth: ``velocity`` is ahead, to the left [m/s], and its turn [rad/s].

    ``slips`` is the share by which it goes less far than its wheels roll.
    """

    def __init__(self, clock, dead_time_s, lag_s, slips=0.005):
        self.clock, self.dead_time_s, self.lag_s, self.slips = clock, dead_time_s, lag_s, slips
        self.x_m, self.y_m, self.heading_rad = 3.0, -2.0, 3.0
        self.velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
        self._target: tuple[float, ...] = self.velocity
        self._orders = deque[tuple[float, tuple[float, ...]]]()
        self.is_braked = False  # by itself, whatever is ordered
        self._now_s = clock()
        self.chance = random.Random(1)

    def order(self, v_m_s, w_rad_s, vy_m_s=0.0):
        self._orders.append((self.clock() + self.dead_time_s, (v_m_s, vy_m_s, w_rad_s)))

    @property
    def is_moving(self):
        return max(map(abs, self.velocity)) > 0.005

    def move(self):
        """Move up to the present, and give what has passed, in steps [s]."""
        while self._now_s + STEP_S <= self.clock():
            self._now_s += STEP_S
            while self._orders and self._orders[0][0] <= self._now_s:
                self._target = self._orders.popleft()[1]
            share = 1 - math.exp(-STEP_S / self.lag_s)
            target = (0.0, 0.0, 0.0) if self.is_braked else self._target
            pairs = zip(self.velocity, target, strict=True)
            self.velocity = tuple(now + share * (to - now) for now, to in pairs)
            ahead, aside, turn = (STEP_S * (1 - self.slips) * one for one in self.velocity)
            along = self.heading_rad + turn / 2
            self.x_m += ahead * math.cos(along) - aside * math.sin(along)
            self.y_m += ahead * math.sin(along) + aside * math.cos(along)
            self.heading_rad += turn
            yield STEP_S

    def away(self):
        """How far it is from where it began: [m], [°]."""
        turned = math.remainder(self.heading_rad - 3.0, math.tau)
        return math.hypot(self.x_m - 3.0, self.y_m + 2.0), abs(math.degrees(turned))


def write_odometry(x_m, y_m, heading_rad, linear, w_rad_s, stamp_s, *, ros=1):
    """An Odometry as a bridge of ROS 1 or 2 gives it."""
    names = ("secs", "nsecs") if ros == 1 else ("sec", "nanosec")
    stamp = dict(zip(names, (int(stamp_s), int(stamp_s % 1 * 1e9)), strict=True))
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(heading_rad / 2), "w": math.cos(heading_rad / 2)}
    twist = {"linear": {"x": linear[0], "y": linear[1], "z": 0.0}}
    twist |= {"angular": {"x": 0.0, "y": 0.0, "z": w_rad_s}}
    pose = {"position": {"x": x_m, "y": y_m, "z": 0.0}, "orientation": turned}
    return {
        "header": {"stamp": stamp, "frame_id": "odom"},
        "child_frame_id": "base_link",
        "pose": {"pose": pose, "covariance": [0.0] * 36},
        "twist": {"twist": twist, "covariance": [0.0] * 36},
    }
