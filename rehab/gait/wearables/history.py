"""The last seconds of a worn sensor, and what a stride's figures are measured from."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from rehab.gait.wearables.orientation import NOWHERE, Vector, cross, dot, mix, remove_part

KEEP_S = 8.0  # the longest stride, and what is decided after it
FLAT_RAD_S = 0.6  # below it a foot stands flat
FLAT_S = 0.06
STILL = (0.2, 0.6)  # of stance, where a foot stands
PUSH_SHARE = 0.6  # of stance, at its end, in which the heel rises


class Moment(NamedTuple):
    """One sample.

    Attributes
    ----------
    time_s
        When it was taken [s].
    rate_rad_s, angle_rad
        Of rotation about the axis, and its integral since the start: positive toes-down.
    speed_rad_s
        Of rotation about any axis.
    heading_rad
        The integral of rotation about the vertical.
    up
        The vertical in the sensor's frame; of no length while it is not known.
    """

    time_s: float
    rate_rad_s: float
    angle_rad: float
    speed_rad_s: float
    heading_rad: float
    up: Vector


class History:
    """The moments of the last seconds."""

    def __init__(self) -> None:
        self._moments: deque[Moment] = deque()

    def add(self, moment: Moment) -> None:
        """Add a moment, and forget those of ``KEEP_S`` ago."""
        moments = self._moments
        moments.append(moment)
        while moments[0].time_s < moment.time_s - KEEP_S:
            moments.popleft()

    def between(self, begin_s: float, end_s: float) -> Iterator[Moment]:
        """Return the moments from one time up to another."""
        return (one for one in self._moments if begin_s <= one.time_s <= end_s)

    def find_motion(self, begin_s: float, end_s: float) -> float:
        """Return how much a leg moves in the middle of a stance [rad/s]: little, if it is one."""
        length_s = end_s - begin_s
        rates = [
            abs(one.rate_rad_s)
            for one in self.between(begin_s + STILL[0] * length_s, begin_s + STILL[1] * length_s)
        ]
        return sum(rates) / len(rates) if rates else math.inf

    def find_foot_strike(self, begin_s: float, end_s: float, sign: float) -> float | None:
        """Return how far the toes were up at initial contact [rad], against the flat foot after it.

        None where the foot is never flat. It is flat while it does not turn for ``FLAT_S``.
        """
        at_contact: float | None = None
        flat: list[Moment] = []
        for one in self.between(begin_s - 0.05, end_s):
            if one.time_s <= begin_s or at_contact is None:
                at_contact = one.angle_rad
            elif one.speed_rad_s < FLAT_RAD_S:
                flat.append(one)
            elif flat and flat[-1].time_s - flat[0].time_s >= FLAT_S:
                break
            else:
                flat.clear()
        if at_contact is None or not flat or flat[-1].time_s - flat[0].time_s < FLAT_S:
            return None
        return sign * (sum(one.angle_rad for one in flat) / len(flat) - at_contact)

    def find_push_off(self, begin_s: float, end_s: float, sign: float) -> float | None:
        """Return the fastest rotation toes-down while the heel rises [rad/s]."""
        late_s = end_s - PUSH_SHARE * (end_s - begin_s)
        return max((sign * one.rate_rad_s for one in self.between(late_s, end_s)), default=None)

    def find_longest_step(self, begin_s: float, end_s: float) -> float:
        """Return the longest time without a sample [s]."""
        times = [one.time_s for one in self.between(begin_s, end_s)]
        return max((after - before for before, after in pairwise(times)), default=math.inf)

    def find_mean_step(self, begin_s: float, end_s: float) -> float:
        """Return the mean time between samples [s]."""
        times = [one.time_s for one in self.between(begin_s, end_s)]
        return (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else math.inf

    def find_turn(self, begin_s: float, end_s: float) -> float:
        """Return by how far the sensor turned about the vertical from one time to another [rad]."""
        headings = [one.heading_rad for one in self.between(begin_s, end_s)]
        return abs(headings[-1] - headings[0]) if headings else 0.0

    def find_lean(self, time_s: float, upright: Vector, left: Vector) -> float | None:
        """Return how far a sensor leans forward against its upright posture [rad]."""
        last: Moment | None = None
        for one in self.between(time_s - 0.1, time_s):
            last = one
        if last is None or last.up == NOWHERE:
            return None
        now, then = remove_part(last.up, left), remove_part(upright, left)
        return math.atan2(dot(left, cross(now, then)), dot(now, then))

    def find_rest(self, begin_s: float, end_s: float) -> Vector:
        """Return the mean vertical in the middle of a stance; of no length where unknown."""
        length_s = end_s - begin_s
        ups = [
            one.up
            for one in self.between(begin_s + STILL[0] * length_s, begin_s + STILL[1] * length_s)
        ]
        mean = NOWHERE
        if NOWHERE in ups:
            return mean
        for count, up in enumerate(ups, 1):
            mean = mix(mean, up, 1 / count)
        return mean
