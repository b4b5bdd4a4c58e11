"""Strides of a foot or shank with a gyroscope, whose sign is found."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.contacts.gyroscope import ContactKind, GyroscopeContact, GyroscopeDetector
from rehab.gait.signals.clock import SampleClock, estimate_rate
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import read_chunk
from rehab.gait.strides import GaitInputError

STRIDE_MIN_S, STRIDE_MAX_S = 0.5, 6.0
STRIDES_MIN = 3  # of a sign that may be the right one
STRIDES_SURE = 5  # of the better one: the other has had its three by then, if it has any
STRIDES_JUDGED = 20
KEEP_S = STRIDE_MAX_S + 2.0
STILL = (0.2, 0.6)  # of stance, where a foot stands


@dataclass(frozen=True, slots=True)
class GyroscopeStride:
    """A stride by its contacts: from one initial contact to the next.

    Attributes
    ----------
    initial_contact_s, terminal_contact_s
        Of its stance [s].
    stride_s, stance_s
        Its times [s].
    cadence_min
        Steps a minute of both legs: two a stride.
    """

    initial_contact_s: float
    terminal_contact_s: float
    stride_s: float
    stance_s: float
    cadence_min: float


class GyroscopeStrideDetector:
    """Detects strides in samples as they come, and with which sign the rate is to be read.

    With the right sign the sensor is nearly still between a contact and the next departure. The
    first strides are returned once there are five. Samples that come late are put back.

    Parameters
    ----------
    rate_hz, segment
        As in ``GyroscopeDetector``.

    Raises
    ------
    GaitInputError
        For other rates and segments.
    """

    def __init__(self, rate_hz: float, *, segment: str = "foot") -> None:
        self._clock = SampleClock()
        self._kept = np.empty((2, 0))  # times and rates of the last seconds
        self._readings = [_Reading(rate_hz, segment, sign) for sign in (1.0, -1.0)]
        self._best: _Reading | None = None

    @property
    def sign(self) -> float | None:
        """The sign with which the rate is read: 1 or -1; None until that is known."""
        return None if self._best is None else self._best.sign

    def feed(self, t_s: ArrayLike, rate_rad_s: ArrayLike) -> list[GyroscopeStride]:
        """Add the next samples and return the strides that they complete.

        Parameters
        ----------
        t_s, rate_rad_s
            Times [s] and rates [rad/s], shape (n,), about the axis to the left or to the right.

        Raises
        ------
        GaitInputError
            For arrays of different lengths.
        """
        table = np.array(read_chunk(("t_s", "rate_rad_s"), (t_s, rate_rad_s)), np.float64)
        return self._add(self._clock.add(table)[0])

    def finish(self) -> list[GyroscopeStride]:
        """Return the strides of samples that are still held back."""
        held = self._clock.finish()
        return [] if held is None else self._add(held)

    def _add(self, table: Floats) -> list[GyroscopeStride]:
        kept = self._kept = np.concatenate((self._kept, table), axis=1)
        for reading in self._readings:
            reading.add(table, kept)
        if max(len(one.motions) for one in self._readings) >= STRIDES_SURE:
            known = [one for one in self._readings if len(one.motions) >= STRIDES_MIN]
            self._best = min(known, key=lambda one: median(one.motions))
        for reading in self._readings:
            if self._best is not None and reading is not self._best:
                reading.strides.clear()
        if kept.shape[1]:
            self._kept = kept[:, ~(kept[0] < kept[0, -1] - KEEP_S)]
        if self._best is None:
            return []
        strides, self._best.strides = self._best.strides, []
        return strides


class _Reading:
    """The strides of a rate that is read with one sign."""

    def __init__(self, rate_hz: float, segment: str, sign: float) -> None:
        self.sign = sign
        self.strides: list[GyroscopeStride] = []
        self.motions: deque[float] = deque(maxlen=STRIDES_JUDGED)
        self._detector = GyroscopeDetector(rate_hz, segment=segment)
        self._begin_s: float | None = None
        self._end_s: float | None = None

    def add(self, table: Floats, kept: Floats) -> None:
        for contact in self._detector.feed(table[0], self.sign * table[1]):
            self._follow(contact, kept)

    def _follow(self, contact: GyroscopeContact, kept: Floats) -> None:
        if contact.kind is ContactKind.TERMINAL:
            if self._end_s is None and self._begin_s is not None:
                self._end_s = contact.time_s
            return
        begin_s, end_s = self._begin_s, self._end_s
        self._begin_s, self._end_s = contact.time_s, None
        if begin_s is None or end_s is None or not begin_s < end_s < contact.time_s:
            return
        stride_s = contact.time_s - begin_s
        if not STRIDE_MIN_S <= stride_s <= STRIDE_MAX_S:
            return
        stance_s = end_s - begin_s
        self.strides.append(GyroscopeStride(begin_s, end_s, stride_s, stance_s, 2 * 60 / stride_s))
        first, stop = np.searchsorted(kept[0], [begin_s + share * stance_s for share in STILL])
        motion = np.abs(kept[1, first:stop])
        if len(motion):
            self.motions.append(float(motion.mean()))


def measure_gyroscope(
    t_s: Floats, rate_rad_s: Floats, *, segment: str = "foot"
) -> tuple[list[GyroscopeStride], float]:
    """Return the strides of a recorded rate of rotation, and the sign with which it was read.

    Parameters
    ----------
    t_s, rate_rad_s, segment
        As in ``GyroscopeStrideDetector``, for the whole recording.

    Raises
    ------
    GaitInputError
        With the cure, where no strides are found with either sign.
    """
    detector = GyroscopeStrideDetector(estimate_rate(t_s), segment=segment)
    strides = detector.feed(t_s, rate_rad_s) + detector.finish()
    if detector.sign is None:
        raise GaitInputError(
            "No strides are found with either sign. Map the rate about the axis from left to "
            "right, in rad/s (COLUMN*0.01745 for degrees), of at least five strides."
        )
    return strides, detector.sign
