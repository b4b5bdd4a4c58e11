"""A stance at even times, as filters need it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import ANGLE, FORCE, TIME

MIN_STANCE_SAMPLES = 8  # of a stance; 0.16 s at 50 Hz


@dataclass(frozen=True, slots=True)
class ResampledStance:
    """Force [N], moment [Nm] and angle [rad] around a stance at even times: shape (3, n).

    The first sample is of ``first_s``. Samples ``begin`` to ``end`` lie within the stance, which
    lasts from ``begin_s`` to ``end_s``.
    """

    signals: Floats
    rate_hz: float
    first_s: float
    begin_s: float
    end_s: float
    begin: int
    end: int

    def index(self, share: float) -> int:
        """Give the first sample after a share of the stance, the last one if there is none."""
        time_s = self.begin_s + share * (self.end_s - self.begin_s)
        return min(max(0, math.ceil((time_s - self.first_s) * self.rate_hz)), self.end)


def resample_stance(
    window: Floats, rate_hz: float, begin_s: float, end_s: float
) -> ResampledStance | None:
    """Give a stance at even times, the last of which is the last sample's; None if it is too short.

    Parameters
    ----------
    window
        Shape (4 or more, n): time, force, moment, angle; time increasing.
    """
    time_s = window[TIME]
    first, last = float(time_s[0]), float(time_s[-1])
    count = int((last - first) * rate_hz + 1e-6) + 1
    grid = last - np.arange(count - 1, -1, -1) / rate_hz
    signals = np.empty((3, count))
    for row, values in zip(signals, window[FORCE : ANGLE + 1], strict=True):
        row[:] = np.interp(grid, time_s, values)
    first = float(grid[0])
    begin = max(0, math.ceil((begin_s - first) * rate_hz))
    end = min(count - 1, int((end_s - first) * rate_hz + 1e-6))
    if end - begin < MIN_STANCE_SAMPLES:
        return None
    return ResampledStance(signals, rate_hz, first, begin_s, end_s, begin, end)
