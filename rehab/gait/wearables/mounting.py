"""Whether a worn sensor still sits as it did."""

from __future__ import annotations

import math

from rehab.gait.wearables.orientation import NOWHERE, Vector, find_angle, mix

LEARNED = 10  # strides by which the usual posture is known
LATEST = 1 / 3  # weight of a stride in the latest posture
TILT_RAD = math.radians(12)  # people after a stroke vary by up to 10.5 (stroke_imu)
AXIS_RAD = math.radians(20)


class Mounting:
    """Compares how a sensor sits in each stance with how it sat in its first strides."""

    def __init__(self) -> None:
        self._strides = 0
        self._usual = self._usual_axis = NOWHERE
        self._latest = NOWHERE

    def add(self, up: Vector, axis: Vector) -> bool:
        """Add a stride: the vertical in its stance, and its axis. Return whether the sensor moved.

        It has if it is tilted by 12° against its first ten strides, over the last few, or its axis
        has turned by 20°. An axis of no length is uncertain, and says nothing.
        """
        self._strides += 1
        if self._strides == 1:
            self._latest = up
        self._latest = mix(self._latest, up, LATEST)
        if self._strides <= LEARNED:
            self._usual = mix(self._usual, up, 1 / self._strides)
            self._usual_axis = axis
            return False
        turned = find_angle(axis, self._usual_axis)
        return find_angle(self._latest, self._usual) > TILT_RAD or (
            AXIS_RAD < turned < math.pi - AXIS_RAD
        )
