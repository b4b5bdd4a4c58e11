"""Zero-phase filter for short stretches of signal, derivatives, peaks and order statistics."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

Floats = NDArray[np.float64]

CUTOFF_HZ = 6.0  # of moments and angles (docs/reference/gait.md#filters)

_FIVE_POINTS = np.array([1.0, -8.0, 0.0, 8.0, -1.0])


class ZeroPhaseFilter:
    """A Butterworth low-pass of second order, run forward and backward: no delay, -6 dB at cut-off.

    As scipy's ``filtfilt``, with which the published references of A2 are made, but as the one
    symmetric impulse response that both runs have together, computed once.

    Parameters
    ----------
    cutoff_hz
        Cut-off of one run. 6 Hz is usual for ankle power in walking (Winter 1991;
        docs/reference/gait.md#filters).
    rate_hz
        Of the samples.
    """

    def __init__(self, cutoff_hz: float, rate_hz: float) -> None:
        # Four time constants of the slowest decay: samples further away have no influence.
        decay = rate_hz / (2 * np.pi * cutoff_hz * np.sqrt(0.5))
        self.padding = max(3, round(4 * decay))
        self.reach = max(3, round(8 * decay))
        b, a = butter(2, cutoff_hz / (rate_hz / 2))
        impulse = np.zeros(4 * self.reach + 1)
        impulse[2 * self.reach] = 1.0
        response = lfilter(b, a, lfilter(b, a, impulse)[::-1])[self.reach : -self.reach]
        self._response: Floats = np.asarray((response + response[::-1]) / (2 * response.sum()))

    def smooth(self, signals: Floats) -> Floats:
        """Return each row filtered, after a point-symmetric extension at its ends.

        Parameters
        ----------
        signals
            Shape (rows, samples), evenly spaced, all finite.
        """
        n = min(self.padding, signals.shape[1] - 1)
        first, last = signals[:, :1], signals[:, -1:]
        before = 2 * first - signals[:, n:0:-1]
        after = 2 * last - signals[:, -2 : -n - 2 : -1]
        return self.smooth_extended(np.concatenate((before, signals, after), axis=1), n)

    def smooth_extended(self, signals: Floats, padding: int) -> Floats:
        """Return rows filtered, without the samples that extend them, shape (rows, n - 2 padding).

        Parameters
        ----------
        signals
            Shape (rows, n), evenly spaced, all finite. Where the filter reaches beyond them, the
            first and the last sample stand for all others.
        padding
            How many samples at each end only extend the signal.
        """
        more = max(0, self.reach - padding)
        rows, count = signals.shape
        wide = np.empty((rows, count + 2 * more))
        wide[:, :more] = signals[:, :1]
        wide[:, more : more + count] = signals
        wide[:, more + count :] = signals[:, -1:]
        cut = max(0, padding - self.reach)
        smooth = self.smooth_wide(wide)
        return smooth[:, cut : smooth.shape[1] - cut]

    def smooth_wide(self, wide: Floats) -> Floats:
        """Return rows filtered and without the ``reach`` samples that they have at each end."""
        smooth = np.empty((len(wide), wide.shape[1] - 2 * self.reach))
        for row, values in zip(smooth, wide, strict=True):
            row[:] = np.correlate(values, self._response, "valid")  # which is symmetric
        return smooth


def differentiate(values: Floats, rate_hz: float) -> Floats:
    """Return the derivative by time, of the same length.

    Five-point central difference: at 100 Hz it attenuates a motion of 5 Hz by 0.02 %, where the
    three-point one attenuates it by 1.6 % (so that rates agree). The two samples at each end get
    shorter differences.

    Parameters
    ----------
    values
        Shape (n,) with n >= 5, evenly spaced.
    rate_hz
        Of the samples.
    """
    slope = np.empty_like(values)
    slope[2:-2] = np.correlate(values, _find_five_points(rate_hz), "valid")
    first, second, third = values[:3].tolist()
    slope[0], slope[1] = (second - first) * rate_hz, (third - first) * (rate_hz / 2)
    third, second, first = values[-3:].tolist()
    slope[-2], slope[-1] = (first - third) * (rate_hz / 2), (first - second) * rate_hz
    return slope


@cache
def _find_five_points(rate_hz: float) -> Floats:
    return _FIVE_POINTS * (rate_hz / 12)


def average(values: Floats, width: int) -> Floats:
    """Return the moving average, shape (n - width + 1,).

    Parameters
    ----------
    values
        Shape (n,), n >= ``width``.
    width
        How many neighbors each mean is of.
    """
    means: Floats = np.correlate(values, find_shares(width), "valid")
    return means


@cache
def find_shares(width: int) -> Floats:
    """Return the weights of a mean of ``width`` values."""
    return np.full(width, 1 / width)


def interpolate_peak(values: Floats, index: int) -> tuple[float, float]:
    """Return place (in samples) and height of the parabola through a peak and its neighbors.

    Parameters
    ----------
    values
        Shape (n,).
    index
        Of the highest sample, with a neighbor on each side.
    """
    left, top, right = values[index - 1 : index + 2].tolist()
    bend = left - 2 * top + right
    if bend >= 0:
        return float(index), top
    shift = 0.5 * (left - right) / bend
    return index + shift, top - 0.25 * (left - right) * shift


# Of a few hundred values: numpy's own reductions cost four times as much, its median five times.


def is_finite(values: Floats) -> bool:
    """Return whether all values are finite, of shape (n,)."""
    # Squares of very large values are not, though.
    return math.isfinite(values.dot(values)) or bool(np.isfinite(values).all())


def find_maximum(values: Floats) -> float:
    """Return the largest value, NaN if there is a NaN."""
    return values.item(values.argmax())


def find_finite_maximum(values: Floats) -> float:
    """Return the largest finite value, 0 without one."""
    largest = find_maximum(values) if len(values) else 0.0
    if math.isfinite(largest):
        return largest
    finite = values[np.isfinite(values)]
    return find_maximum(finite) if len(finite) else 0.0


def find_minimum(values: Floats) -> float:
    """Return the smallest value, NaN if there is a NaN."""
    return values.item(values.argmin())


def find_upper_median(values: Floats) -> float:
    """Return the median, of an even number of values the upper one of the middle two."""
    ordered = values.copy()
    ordered.sort()  # in vectors, unlike a partition
    return ordered.item(len(values) // 2)


def find_last(found: NDArray[np.bool_]) -> int:
    """Return the index of the last true value, -1 without one."""
    if not len(found):
        return -1
    behind = int(found[::-1].argmax())
    return len(found) - 1 - behind if behind or found[-1] else -1
