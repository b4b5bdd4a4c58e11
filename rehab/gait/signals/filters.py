"""Zero-phase filter for short stretches of signal, derivatives, peaks and order statistics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

Floats = NDArray[np.float64]


class ZeroPhaseFilter:
    """A Butterworth low-pass of second order, run forward and backward.

    Both runs together have no delay, and attenuate by 6 dB at the cut-off (as scipy's ``filtfilt``,
    with which the published references of A2 are made).

    Parameters
    ----------
    cutoff_hz
        Cut-off of one run. 6 Hz is usual for ankle power in walking (Winter 1991;
        docs/reference/gait.md#filters).
    rate_hz
        Of the samples.
    """

    def __init__(self, cutoff_hz: float, rate_hz: float) -> None:
        self._b, self._a = butter(2, cutoff_hz / (rate_hz / 2))
        self._settled = np.asarray(lfilter_zi(self._b, self._a), dtype=np.float64)[np.newaxis]
        # Four time constants of the slowest decay: samples further away have no influence.
        self.padding = max(3, round(4 * rate_hz / (2 * np.pi * cutoff_hz * np.sqrt(0.5))))

    def smooth(self, signals: Floats) -> Floats:
        """Return each row filtered, extended point-symmetrically beyond its ends for the purpose.

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
        """Return rows filtered and without the ``padding`` samples that they have at each end."""
        forward, _ = lfilter(self._b, self._a, signals, zi=signals[:, :1] * self._settled)
        turned = forward[:, ::-1]
        backward, _ = lfilter(self._b, self._a, turned, zi=turned[:, :1] * self._settled)
        smooth: Floats = backward[:, ::-1]
        return smooth[:, padding : smooth.shape[1] - padding]


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
    slope[2:-2] = (8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) * (rate_hz / 12)
    slope[1] = (values[2] - values[0]) * (rate_hz / 2)
    slope[-2] = (values[-1] - values[-3]) * (rate_hz / 2)
    slope[0] = (values[1] - values[0]) * rate_hz
    slope[-1] = (values[-1] - values[-2]) * rate_hz
    return slope


def interpolate_peak(values: Floats, index: int) -> tuple[float, float]:
    """Return place (in samples) and height of the parabola through a peak and its neighbors.

    Parameters
    ----------
    values
        Shape (n,).
    index
        Of the highest sample, with a neighbor on each side.
    """
    left, top, right = (float(v) for v in values[index - 1 : index + 2])
    bend = left - 2 * top + right
    if bend >= 0:
        return float(index), top
    shift = 0.5 * (left - right) / bend
    return index + shift, top - 0.25 * (left - right) * shift


# Of a few hundred values: numpy's own reductions cost four times as much, its median five times.


def find_maximum(values: Floats) -> float:
    """Return the largest value, NaN if there is a NaN."""
    return float(values[values.argmax()])


def find_minimum(values: Floats) -> float:
    """Return the smallest value, NaN if there is a NaN."""
    return float(values[values.argmin()])


def find_upper_median(values: Floats) -> float:
    """Return the median, of an even number of values the upper one of the middle two."""
    place = len(values) // 2
    return float(np.partition(values, place)[place])
