"""Strides of one worn sensor, sample by sample, however it is mounted."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.strides import GaitInputError
from rehab.gait.wearables.axis import SagittalAxis
from rehab.gait.wearables.axis_sign import STRIDES_SURE, find_sign
from rehab.gait.wearables.doubtful_strides import Reading
from rehab.gait.wearables.history import History, Moment
from rehab.gait.wearables.mounting import Mounting
from rehab.gait.wearables.orientation import NOWHERE, Orientation, Vector, dot
from rehab.gait.wearables.standing import Standing
from rehab.gait.wearables.strides import Doubt, Place, WearableStride
from rehab.gait.wearables.swings import GAP_S

HELD_S = 60.0  # how long samples wait until the axis is known
STRIDES_ASKED = 12  # from which a sign that is still unknown is asked for
STRIDES_MOVED = 5  # that do not count after the sensor moved


class _Sample(NamedTuple):
    time_s: float
    step_s: float
    rate: Vector
    mean_rate: Vector  # since the sample before
    acceleration: Vector | None
    up: Vector
    is_settled: bool  # the vertical


class WearableDetector:
    """Measures the strides of a foot or shank in samples as they come.

    It finds about which axis the leg swings, and which end of that axis points to the walker's left
    by two signs that must not disagree: where the leg travels, and that it is quiet in what are
    then its stances. Until that is known no stride is returned; those that wait are returned then.
    Thresholds follow the person. A stride is known at most 0.15 s after the initial contact that
    ends it.

    Parameters
    ----------
    place
        Where it is worn: "foot" or "shank".

    Raises
    ------
    GaitInputError
        For another place.
    """

    _contrary = 0  # looks in a row that say the other sign

    def __init__(self, place: str) -> None:
        if place not in tuple(Place):
            raise GaitInputError(f"A sensor on the {place} is not known. Use foot or shank.")
        self._place = Place(place)
        self._last_s = math.nan
        self._last_rate = NOWHERE
        self._moved = 0  # strides that still do not count
        self._begin()

    @property
    def sign(self) -> float | None:
        """With which sign the axis points to the walker's left; None until that is known."""
        return None if self._best is None else self._best.sign

    @property
    def left(self) -> Vector | None:
        """The axis to the walker's left in the sensor's frame; None until it is known."""
        if self._best is None:
            return None
        sign, axis = self._best.sign, self._axis.axis
        return sign * axis[0], sign * axis[1], sign * axis[2]

    @property
    def is_in_doubt(self) -> bool:
        """Whether somebody has to say which way is up: no stride is returned until then.

        The patient stands still and lifts the toes once (a foot), or swings the lower leg forward
        once (a shank).
        """
        return self._best is None and max(one.total for one in self._readings) >= STRIDES_ASKED

    def feed(
        self, t_s: ArrayLike, rate_rad_s: ArrayLike, acceleration_m_s2: ArrayLike | None = None
    ) -> list[WearableStride]:
        """Add the next samples and return the strides that they complete.

        Parameters
        ----------
        t_s
            Times by the sensor's own clock or count [s], shape (n,). More than 0.1 s without a
            sample is a gap, which no stride reaches across.
        rate_rad_s
            Rate of rotation, shape (n, 3) about the sensor's axes, or (n,) about the one from left
            to right, with either sign.
        acceleration_m_s2
            Acceleration with gravity, shape (n, 3); None where there is none: then turning, lean
            and a sensor that moved are not seen. A sample with a NaN is left out.

        Raises
        ------
        GaitInputError
            For arrays of other shapes.
        """
        times = np.atleast_1d(np.asarray(t_s, np.float64))
        rates = np.asarray(rate_rad_s, np.float64)
        if rates.ndim < 2:
            rates = np.atleast_1d(rates)[:, np.newaxis] * (1.0, 0.0, 0.0)
        columns = [times[:, np.newaxis], rates]
        if acceleration_m_s2 is not None:
            columns.append(np.atleast_2d(np.asarray(acceleration_m_s2, np.float64)))
        if times.ndim != 1 or any(one.shape != (len(times), 3) for one in columns[1:]):
            raise GaitInputError(
                f"{len(times)} times come with rates of shape {rates.shape}. Feed as many rows of "
                "three rates, and of three accelerations, as times."
            )
        strides: list[WearableStride] = []
        for row in np.hstack(columns).tolist():
            if all(map(math.isfinite, row)):
                strides += self.add(row[0], tuple(row[1:4]), tuple(row[4:]) or None)
        return strides

    def add(
        self, time_s: float, rate: Vector, acceleration: Vector | None = None
    ) -> list[WearableStride]:
        """Add a sample [s, rad/s, m/s²] and return the strides that it completes."""
        step_s, last = time_s - self._last_s, self._last_rate
        self._last_s, self._last_rate = time_s, rate
        if not 0 < step_s <= GAP_S:
            self._orientation.restart()
            for reading in self._readings:
                reading.restart()
            return []
        mean = ((rate[0] + last[0]) / 2, (rate[1] + last[1]) / 2, (rate[2] + last[2]) / 2)
        up = NOWHERE
        if acceleration is None:
            self._axis.add_rotation(step_s, rate)
        else:
            self._orientation.add(step_s, acceleration, mean)
            self._axis.add(step_s, acceleration, rate, self._orientation)
            up = self._orientation.up
        self._held.append(
            _Sample(time_s, step_s, rate, mean, acceleration, up, self._orientation.is_settled)
        )
        if not self._axis.is_known:
            if self._held[0].time_s < time_s - HELD_S:
                self._held.popleft()
            return []
        while self._held:
            self._follow(self._held.popleft())
        return self._release()

    def _begin(self) -> None:
        """Find axis and sign, as at the start or once the sensor moved."""
        self._orientation, self._axis = Orientation(), SagittalAxis()
        self._mounting, self._history, self._standing = Mounting(), History(), Standing()
        self._angle_rad = self._heading_rad = 0.0
        self._held: deque[_Sample] = deque()
        self._readings = [Reading(sign, self._place, self._history) for sign in (1.0, -1.0)]
        self._best: Reading | None = None
        self._is_certain = False  # by what the patient was asked to do
        self._judged = 0  # strides by the newest look at the sign

    def _follow(self, sample: _Sample) -> None:
        axis, rate = self._axis.axis, sample.rate
        turning = dot(rate, axis)
        self._angle_rad += sample.step_s * dot(sample.mean_rate, axis)
        self._heading_rad += sample.step_s * dot(sample.mean_rate, sample.up)
        speed = math.sqrt(dot(rate, rate))
        self._history.add(
            Moment(
                sample.time_s,
                turning,
                self._angle_rad,
                speed,
                self._heading_rad,
                sample.up if sample.is_settled else NOWHERE,
            )
        )
        lifted = self._standing.add(
            sample.step_s, speed, sample.acceleration, sample.up, self._angle_rad
        )
        if lifted is not None and self.is_in_doubt:
            # Toes go up with a falling angle, if the axis points left.
            self._best = next(one for one in self._readings if one.sign == -lifted)
            self._is_certain = True
        for reading in self._readings:
            reading.add(sample.time_s, turning, axis, self._standing.upright)

    def _release(self) -> list[WearableStride]:
        """Return the strides that are known, if the sign is."""
        first, second = self._readings
        if not self._is_certain and first.total + second.total > self._judged:
            self._judged = first.total + second.total
            self._judge()
        if self._best is None:
            return []
        for reading in self._readings:
            if reading is not self._best:
                reading.strides.clear()
        strides = []
        while self._best.strides:
            stride, rest = self._best.strides.popleft()
            axis = self._axis.axis if self._axis.is_sure else NOWHERE
            has_moved = rest != NOWHERE and self._mounting.add(rest, axis)
            if has_moved or self._moved:
                stride = replace(stride, reasons=(*stride.reasons, Doubt.SENSOR_MOVED))
            strides.append(stride)
            self._moved = STRIDES_MOVED if has_moved else max(0, self._moved - 1)
            if has_moved:
                self._begin()
                break
        return strides

    def _judge(self) -> None:
        """Find the sign by the strides of both, or see that the one that is used is wrong."""
        found = find_sign(self._readings, self._axis)
        if found is None:
            return
        if self._best in (None, found):
            self._best, self._contrary = found, 0
        else:
            self._contrary += 1
            if self._contrary >= STRIDES_SURE:
                self._begin()
                self._moved = STRIDES_MOVED
