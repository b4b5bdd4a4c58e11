"""How late a base answers, measured while it moves: the delay that explains its motion best."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from robot.motion.limits import LONGEST_STEP_S, TICK_S
from robot.motion.pose import Pose
from robot.motion.twist import STILL, WHEELBASE_M, Twist

LONGEST_S = 0.4  # delays up to here are looked for
STEPS = round(LONGEST_S / TICK_S)
WHEEL_M = WHEELBASE_M / 2  # from the middle to a wheel: weighs turns against ways
ENOUGH_S = 0.6  # of motion, before anything is concluded
FADES_S = 20.0  # of motion: what is older counts less
# The best delay has to leave no more than this share of the motion unexplained. Of a base that is
# held, or pushed, nothing is learnt.
UNEXPLAINED = 0.25


class DelayMeter:
    """Compares how a base moves with what it was ordered a moment before, for each such moment.

    Time goes by in steps of ``TICK_S``, as a player's does.
    """

    def __init__(self) -> None:
        # What was ordered in the latest ticks, the newest first.
        self._orders: deque[Twist] = deque([STILL] * (STEPS + 1), maxlen=STEPS + 1)
        self._costs = [0.0] * (STEPS + 1)
        self._energy = self._moved_s = 0.0
        self._last: tuple[float, Pose] | None = None

    def add(self, ordered: Twist, pose: Pose, now_s: float) -> None:
        """Add a tick: what was ordered last before it, and where the base is now.

        Parameters
        ----------
        ordered
            The order that held up to now.
        pose
            Where the base is by its odometry.
        now_s
            The time [s].
        """
        last, self._last = self._last, (now_s, pose)
        self._orders.appendleft(ordered)
        if last is None or not 0 < now_s - last[0] <= LONGEST_STEP_S:
            return
        if all(order.is_still for order in self._orders):
            return
        elapsed_s = now_s - last[0]
        before, turned_rad = last[1], pose.heading_rad - last[1].heading_rad
        midway = replace(before, heading_rad=(before.heading_rad + pose.heading_rad) / 2)
        moved = pose.seen_from(midway)
        v_m_s, vy_m_s = moved.x_m / elapsed_s, moved.y_m / elapsed_s
        turn_m_s = WHEEL_M * turned_rad / elapsed_s
        fading = math.exp(-elapsed_s / FADES_S)
        self._energy = self._energy * fading + (v_m_s**2 + vy_m_s**2 + turn_m_s**2) * elapsed_s
        self._moved_s = self._moved_s * fading + elapsed_s
        for ticks, order in enumerate(self._orders):
            error = (order.v_m_s - v_m_s) ** 2 + (order.vy_m_s - vy_m_s) ** 2
            error += (WHEEL_M * order.w_rad_s - turn_m_s) ** 2
            self._costs[ticks] = self._costs[ticks] * fading + error * elapsed_s

    @property
    def delay_s(self) -> float | None:
        """How late the base answers [s], from an order to half of its effect; None if unknown."""
        if self._moved_s < ENOUGH_S:
            return None
        best = min(range(STEPS + 1), key=self._costs.__getitem__)
        if self._costs[best] > UNEXPLAINED * self._energy:
            return None
        return TICK_S * (best + self._offset(best))

    def _offset(self, best: int) -> float:
        """Return where between two ticks the least cost lies: the vertex of a parabola."""
        if not 0 < best < STEPS:
            return 0.0
        before, here, after = self._costs[best - 1 : best + 2]
        curve = before - 2 * here + after
        return (before - after) / (2 * curve) if curve > 0 else 0.0
