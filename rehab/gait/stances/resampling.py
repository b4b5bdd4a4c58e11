"""A stance at evenly spaced times, as filters need it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import ANGLE, FORCE, TIME

MIN_STANCE_SAMPLES = 8  # 0.16 s at 50 Hz


@dataclass(frozen=True, slots=True)
class ResampledStance:
    """Force [N], moment [Nm] and angle [rad] around a stance at evenly spaced times.

    Attributes
    ----------
    signals
        Shape (3, n): force, moment, angle.
    rate_hz
        Of the samples.
    first_s
        Time of the first sample [s].
    begin_s, end_s
        Initial and terminal contact [s].
    begin, end
        First and last sample within the stance.
    """

    signals: Floats
    rate_hz: float
    first_s: float
    begin_s: float
    end_s: float
    begin: int
    end: int

    def index(self, share: float) -> int:
        """Return the first sample after a share of the stance; its last one if there is none."""
        time_s = self.begin_s + share * (self.end_s - self.begin_s)
        return min(max(0, math.ceil((time_s - self.first_s) * self.rate_hz)), self.end)


def resample_stance(
    window: Floats, rate_hz: float, begin_s: float, end_s: float, kinetics_s: Floats | None = None
) -> ResampledStance | None:
    """Return a stance at evenly spaced times that end with the last sample's time.

    Parameters
    ----------
    window
        Shape (4 or more, n): time, force, moment, angle; time increasing.
    rate_hz
        Of the result.
    begin_s, end_s
        Initial and terminal contact [s].
    kinetics_s
        When moment and angle were measured, if not when the force was [s], shape (n,).

    Returns
    -------
    None for a stance of fewer than nine samples.
    """
    time_s = window[TIME]
    first, last = float(time_s[0]), float(time_s[-1])
    count = int((last - first) * rate_hz + 1e-6) + 1
    grid = last - np.arange(count - 1, -1, -1) / rate_hz
    signals = np.empty((3, count))
    times = (time_s, *(2 * (time_s if kinetics_s is None else kinetics_s,)))
    for row, values, taken_s in zip(signals, window[FORCE : ANGLE + 1], times, strict=True):
        row[:] = np.interp(grid, taken_s, values)
    first = float(grid[0])
    begin = max(0, math.ceil((begin_s - first) * rate_hz))
    end = min(count - 1, int((end_s - first) * rate_hz + 1e-6))
    if end - begin < MIN_STANCE_SAMPLES:
        return None
    return ResampledStance(signals, rate_hz, first, begin_s, end_s, begin, end)
