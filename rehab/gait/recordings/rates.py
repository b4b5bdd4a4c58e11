"""Channels of different rates in one table."""

from __future__ import annotations

import numpy as np

from rehab.gait.signals.filters import Floats


def resample_channel(values: Floats, rate_hz: float, time_s: Floats) -> Floats:
    """Return a channel that began with the recording, at other times.

    Parameters
    ----------
    values, rate_hz
        Shape (n,), and how many a second.
    time_s
        Wanted times, shape (m,); a channel of as many values has them already.
    """
    if len(values) == len(time_s):
        return np.asarray(values, dtype=np.float64)
    resampled: Floats = np.interp(time_s, np.arange(len(values)) / rate_hz, values)
    return resampled
