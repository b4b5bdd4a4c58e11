"""The axis about which a leg swings, and which end of it points to the walker's left."""

from __future__ import annotations

import math

from rehab.gait.wearables.orientation import (
    NOWHERE,
    Orientation,
    Vector,
    cross,
    dot,
    mix,
    remove_part,
    scale_to_unit,
)

GRAVITY_M_S2 = 9.81
FORGET_S = 30.0
MOVING_RAD_S = 1.0
MOVED_S = 2.0  # of such movement, about three strides, from which the axis is known
SHARE_MIN, SHARE_SURE = 0.6, 0.9  # of all rotation: the axis is by travel, or by rotation alone
TRAVEL_FORGET_S = 10.0
SPEED_S = 1.5  # after which integrated acceleration is forgotten: it drifts
DRIFT_S = 3.0  # over which its mean is drift: a rate that is off by 0.01 rad/s makes 0.4 m/s
SPEED_MAX_M_S = 1.0  # one jerk must not outweigh many strides
QUIET_RAD_S, QUIET_M_S2 = 0.7, 1.5
TRAVEL_M_S = 0.1  # from which the direction of travel is believed
TRAVEL_COSINE = 0.3  # and how well it has to agree with the axis


class SagittalAxis:
    """Finds the horizontal axis to the walker's left, however a sensor is mounted.

    Rotation says the axis: the first principal component of its horizontal part. Travel says the
    left end: between stances a foot moves forward, so that while it stands it is slower than on
    average; forward and upward give left. Where a leg swings around as much as ahead, travel says
    the axis as well.
    """

    def __init__(self) -> None:
        self._xx = self._xy = self._xz = self._yy = self._yz = self._zz = 0.0
        self._moved_s = 0.0
        self._component = NOWHERE
        self._velocity = NOWHERE  # [m/s], in the frame that hardly turns
        self._drift = NOWHERE  # its mean
        self._travels = 0  # samples of both
        self._forward = NOWHERE  # [m/s], in the sensor's frame
        self._up = NOWHERE
        self._quiet_s = 0.0
        self.axis: Vector = NOWHERE  # of length 1, in the sensor's frame

    @property
    def is_known(self) -> bool:
        """Whether the sensor has moved enough."""
        return self._moved_s >= MOVED_S

    @property
    def share(self) -> float:
        """How much of all horizontal rotation is about the first component, 0 to 1."""
        total = self._xx + self._yy + self._zz
        return dot(self._component, self._spread(self._component)) / total if total else 0.0

    @property
    def is_sure(self) -> bool:
        """Whether the rotation alone shows the axis."""
        return self.share >= SHARE_SURE

    @property
    def left_sign(self) -> float | None:
        """Whether the axis points left (1) or right (-1) by where the leg travels; None: unsure."""
        if not self._quiet_s:
            return None
        speed_m_s = math.sqrt(dot(self._forward, self._forward)) / self._quiet_s
        cosine = dot(self._left, self.axis)
        if speed_m_s < TRAVEL_M_S or abs(cosine) < TRAVEL_COSINE:
            return None
        return math.copysign(1.0, cosine)

    @property
    def _left(self) -> Vector:
        return scale_to_unit(cross(self._up, self._forward))

    def add(
        self, step_s: float, acceleration: Vector, rate: Vector, orientation: Orientation
    ) -> None:
        """Add a sample [s, m/s², rad/s] that the orientation has been given."""
        speed = dot(rate, rate)
        if speed > MOVING_RAD_S**2:
            self._add_rotation(step_s, remove_part(rate, orientation.up))
        self._add_travel(step_s, acceleration, speed, orientation)
        # The sign that the axis has is kept: it is judged by others.
        component, left = _face(self._component, self.axis), _face(self._left, self.axis)
        trust = (self.share - SHARE_MIN) / (SHARE_SURE - SHARE_MIN)
        if left == NOWHERE or trust >= 1:
            self.axis = component
        else:
            self.axis = scale_to_unit(mix(left, component, max(trust, 0.0)))

    def add_rotation(self, step_s: float, rate: Vector) -> None:
        """Add the rate of rotation [rad/s] of a sensor without accelerometer."""
        if dot(rate, rate) > MOVING_RAD_S**2:
            self._add_rotation(step_s, rate)
        self.axis = self._component

    def _add_rotation(self, step_s: float, rate: Vector) -> None:
        self._moved_s += step_s
        keep = 1 - step_s / FORGET_S
        x, y, z = rate
        self._xx = keep * self._xx + x * x * step_s
        self._xy = keep * self._xy + x * y * step_s
        self._xz = keep * self._xz + x * z * step_s
        self._yy = keep * self._yy + y * y * step_s
        self._yz = keep * self._yz + y * z * step_s
        self._zz = keep * self._zz + z * z * step_s
        # With each sample it comes nearer to the first component.
        self._component = scale_to_unit(
            self._spread(self._component) if self._component != NOWHERE else rate
        )

    def _add_travel(
        self, step_s: float, acceleration: Vector, speed: float, orientation: Orientation
    ) -> None:
        if not orientation.is_settled:  # an unknown vertical would be taken for travel
            self._velocity, self._travels = NOWHERE, 0
            return
        kept, linear = 1 - step_s / SPEED_S, orientation.linear_m_s2
        velocity = self._velocity
        self._velocity = (
            kept * (velocity[0] + linear[0] * step_s),
            kept * (velocity[1] + linear[1] * step_s),
            kept * (velocity[2] + linear[2] * step_s),
        )
        self._travels += 1
        weight = max(1 / self._travels, step_s / (DRIFT_S + step_s))
        drift = self._drift = mix(self._drift, self._velocity, weight)
        shaken = math.sqrt(dot(acceleration, acceleration)) - GRAVITY_M_S2
        quiet_s = step_s * math.exp(-speed / QUIET_RAD_S**2 - (shaken / QUIET_M_S2) ** 2)
        x, y, z = self._velocity
        ahead = orientation.to_sensor((x - drift[0], y - drift[1], z - drift[2]))
        behind = remove_part(ahead, orientation.up)
        if dot(behind, behind) > SPEED_MAX_M_S**2:
            behind = scale_to_unit(behind)
        keep = 1 - step_s / TRAVEL_FORGET_S
        self._quiet_s = keep * self._quiet_s + quiet_s
        self._forward = _add_scaled(self._forward, keep, behind, -quiet_s)
        self._up = _add_scaled(self._up, keep, orientation.up, quiet_s)

    def _spread(self, vector: Vector) -> Vector:
        """Return the product of the rotations' covariance with a vector."""
        x, y, z = vector
        return (
            self._xx * x + self._xy * y + self._xz * z,
            self._xy * x + self._yy * y + self._yz * z,
            self._xz * x + self._yz * y + self._zz * z,
        )


def _add_scaled(one: Vector, keep: float, other: Vector, weight: float) -> Vector:
    return (
        keep * one[0] + weight * other[0],
        keep * one[1] + weight * other[1],
        keep * one[2] + weight * other[2],
    )


def _face(vector: Vector, towards: Vector) -> Vector:
    """Return a vector, or the one opposite to it, whichever is nearer to another."""
    return vector if dot(vector, towards) >= 0 else (-vector[0], -vector[1], -vector[2])
