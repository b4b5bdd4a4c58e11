"""A stance at evenly spaced times, its gaps bridged, as filters need it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.signals.filters import Floats, find_shares
from rehab.gait.signals.samples import ANGLE, FORCE, MOMENT, TIME
from rehab.gait.stances.gaps import StanceClock

MIN_STANCE_SAMPLES = 8  # 0.16 s at 50 Hz


@dataclass(slots=True)
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


class Resampler:
    """Puts stances at evenly spaced times that end with the last sample's time.

    Parameters
    ----------
    rate_hz
        Of the result.
    longest_s
        From the first to the last sample, at most.
    """

    def __init__(self, rate_hz: float, longest_s: float) -> None:
        self._rate_hz = rate_hz
        self._behind_s = np.arange(int(longest_s * rate_hz) + 1, -1, -1) / rate_hz

    def resample(
        self, window: Floats, begin_s: float, end_s: float, kinetics_s: Floats | None = None
    ) -> ResampledStance | None:
        """Return a stance at even times.

        Parameters
        ----------
        window
            Shape (4, n): time, force, moment, angle; time increasing.
        begin_s, end_s
            Initial and terminal contact [s].
        kinetics_s
            When moment and angle were measured, if not when the force was [s], shape (n,).

        Returns
        -------
        None for a stance of fewer than nine samples.
        """
        rate_hz, time_s = self._rate_hz, window[TIME]
        first, last = time_s.item(0), time_s.item(-1)
        count = int((last - first) * rate_hz + 1e-6) + 1
        grid = last - self._behind_s[-count:]
        if kinetics_s is None:
            kinetics_s = time_s
        signals = np.empty((3, count))
        signals[0] = np.interp(grid, time_s, window[FORCE])
        signals[1] = np.interp(grid, kinetics_s, window[MOMENT])
        signals[2] = np.interp(grid, kinetics_s, window[ANGLE])
        first = grid.item(0)
        begin = max(0, math.ceil((begin_s - first) * rate_hz))
        end = min(count - 1, int((end_s - first) * rate_hz + 1e-6))
        if end - begin < MIN_STANCE_SAMPLES:
            return None
        return ResampledStance(signals, rate_hz, first, begin_s, end_s, begin, end)


def bridge_gaps(window: Floats, clock: StanceClock, is_known: bool) -> tuple[Floats | None, float]:
    """Return a stance's samples with gaps in moment and angle bridged, and the longest bridge [s].

    The samples are None where nothing is known to bridge between; a fifth row is when moment and
    angle were measured, where that is not when the force was. The time is the longest that
    a straight line bridges where that harms A2. Longer gaps have made the stride invalid already,
    so that values measured across them are not shown. ``is_known``: whether nothing is missing.
    """
    time = clock.kinetics_s
    rows = window[: ANGLE + 1]
    if time is not window[TIME] and clock.late_s > 0:
        rows = np.vstack((rows, time))
    longest_s = clock.bridged_s
    if is_known:
        return rows, longest_s
    bridged = rows.copy()
    for row in bridged[MOMENT : ANGLE + 1]:
        known = np.isfinite(row)
        if known.sum() < 2:
            return None, longest_s
        row[~known] = np.interp(time[~known], time[known], row[known])
        longest_s = max(longest_s, float(np.diff(time[known]).max()))
    return bridged, longest_s


def decimate(window: Floats, factor: int) -> Floats | None:
    """Return the means of each ``factor`` neighbors, aligned to the end, if there are two."""
    if factor == 1:
        return window
    rows, samples = window.shape
    count = samples // factor
    if count < 2:
        return None
    neighbors = window[:, samples - count * factor :].reshape(rows, count, factor)
    decimated: Floats = neighbors @ find_shares(factor)
    return decimated
