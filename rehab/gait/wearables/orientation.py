"""Which way is up for a worn sensor, from its own accelerometer and gyroscope."""

from __future__ import annotations

import math

Vector = tuple[float, float, float]

NOWHERE: Vector = (0.0, 0.0, 0.0)
LEVEL_S = 1.5  # time constant of each of two low-passes: what a stride adds averages out
SETTLED_S = 2 * LEVEL_S


class Orientation:
    """Follows a sensor's inclination, sample by sample; its heading is free (a 6D filter).

    The rates are integrated to a quaternion. In the frame that this leaves, which hardly turns,
    mean acceleration is gravity's: the idea of VQF (docs/reference/gait.md#worn-sensors).

    Attributes
    ----------
    up
        The vertical in the sensor's frame, of length 1.
    linear_m_s2
        Acceleration without gravity [m/s²], in the frame that hardly turns.
    """

    def __init__(self) -> None:
        self._q = (1.0, 0.0, 0.0, 0.0)  # from the sensor's frame to the one that hardly turns
        self.restart()

    def restart(self) -> None:
        """Find the vertical anew from the next samples, as after a gap."""
        self._first = self._second = NOWHERE
        self._samples, self._age_s = 0, 0.0
        self.up: Vector = NOWHERE
        self.linear_m_s2: Vector = NOWHERE

    @property
    def is_settled(self) -> bool:
        """Whether the low-passes no longer depend on how they began."""
        return self._age_s >= SETTLED_S

    def add(self, step_s: float, acceleration_m_s2: Vector, rate_rad_s: Vector) -> None:
        """Add a sample that was taken ``step_s`` [s] after the last one.

        Parameters
        ----------
        acceleration_m_s2
            With what holds the sensor up: 9.81 m/s² upward at rest.
        rate_rad_s
            Mean rate of rotation since the last sample.
        """
        self._turn(step_s, rate_rad_s)
        level = self.to_level(acceleration_m_s2)
        self._samples += 1
        self._age_s += step_s
        weight = max(1 / self._samples, step_s / (LEVEL_S + step_s))
        self._first = mix(self._first, level, weight)
        self._second = mix(self._second, self._first, weight)
        up = self._second
        self.linear_m_s2 = (level[0] - up[0], level[1] - up[1], level[2] - up[2])
        self.up = scale_to_unit(self.to_sensor(up))

    def to_level(self, vector: Vector) -> Vector:
        """Return a vector of the sensor's frame in the frame that hardly turns."""
        return _rotate(self._q, vector)

    def to_sensor(self, vector: Vector) -> Vector:
        """Return a vector of the frame that hardly turns in the sensor's frame."""
        w, x, y, z = self._q
        return _rotate((w, -x, -y, -z), vector)

    def _turn(self, step_s: float, rate: Vector) -> None:
        speed = math.sqrt(dot(rate, rate))
        if not speed * step_s:
            return
        share = math.sin(speed * step_s / 2) / speed
        a, b, c, d = self._q
        e, f, g, h = math.cos(speed * step_s / 2), rate[0] * share, rate[1] * share, rate[2] * share
        w, x = a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g
        y, z = a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e
        length = math.sqrt(w * w + x * x + y * y + z * z)
        self._q = (w / length, x / length, y / length, z / length)


def dot(one: Vector, other: Vector) -> float:
    """Return the scalar product."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: Vector, other: Vector) -> Vector:
    """Return the vector product."""
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


def mix(one: Vector, other: Vector, weight: float) -> Vector:
    """Return the weighted mean: ``one`` at a weight of 0, ``other`` at 1."""
    return (
        one[0] + weight * (other[0] - one[0]),
        one[1] + weight * (other[1] - one[1]),
        one[2] + weight * (other[2] - one[2]),
    )


def scale_to_unit(vector: Vector) -> Vector:
    """Return a vector of length 1 in the same direction; one of no length as it is."""
    length = math.sqrt(dot(vector, vector))
    return (vector[0] / length, vector[1] / length, vector[2] / length) if length else vector


def remove_part(vector: Vector, along: Vector) -> Vector:
    """Return a vector without its part along a unit vector."""
    part = dot(vector, along)
    return vector[0] - part * along[0], vector[1] - part * along[1], vector[2] - part * along[2]


def find_angle(one: Vector, other: Vector) -> float:
    """Return the angle between two vectors [rad]."""
    across = cross(one, other)
    return math.atan2(math.sqrt(dot(across, across)), dot(one, other))


def _rotate(q: tuple[float, float, float, float], vector: Vector) -> Vector:
    w, x, y, z = q
    a, b, c = vector
    e, f, g = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * e + y * g - z * f, b + w * f + z * e - x * g, c + w * g + x * f - y * e
