"""Whether angle or moment comes out of time with the force, by the strides before.

What one stride cannot tell several can: an ankle brakes soon after its foot has left, and a moment
falls with its force. A lag of 10 ms or less is within what people differ by; the self-check of the
set-up finds it (``selfcheck.delays``).
"""

from __future__ import annotations

from collections import deque
from statistics import median

import numpy as np

from rehab.gait.signals.filters import (
    Floats,
    ZeroPhaseFilter,
    differentiate,
    find_last,
    find_maximum,
    interpolate_peak,
    is_finite,
)

# A foot that has left the floor stops plantarflexing: the ankle brakes hardest 51 ms after terminal
# contact (moore2013, shown to be in time by its authors: 52.7 ms left, 49.2 ms right). The peak
# moves with an injected lag to 0.3 ms; between people it is taken to differ by 8 ms.
DECELERATION_S = 0.051
DECELERATION_MIN_RAD_S2 = 20.0  # below, there is no push-off to stop
SEARCH_S = (-0.1, 0.2)
SETTLE_S = 0.05  # of the filter
AROUND_S = 0.4
GRID_HZ = 200.0
CUTOFF_HZ = 8.0
# Moment and force fall to half of their late peaks together: 8 ms apart (moore2013), -11 to -3 ms
# where it is simulated.
HALF = 0.5

# One stride is sure to 8 ms (moore2013), so medians are compared: of the newest strides, and of the
# first ones. With that scatter, walks of 200 strides that do not drift lose less than 0.1 %; fewer
# strides or a tighter limit lose up to a tenth of some walks.
STRIDES, OWN_STRIDES = 5, 7
MOMENT_LAG_MAX_S = 0.03
ANGLE_LAG_MAX_S = 0.04  # a dragged foot leaves up to 30 ms before it is seen to
DRIFT_MAX_S = 0.02  # a steady walker's own drifts by 10 ms in a minute (moore2013)
# A clock that runs away is seen earlier by the slope of the lag over the newest strides: five times
# its own error, by what strides scatter, which few strides tell less of than 4 ms known before.
SLOPE_STRIDES, SLOPE_LEAST = 12, 5
SLOPE_ERRORS, SLOPE_MOVED_S = 7.0, 0.01
SCATTER_S, SCATTER_WEIGHT = 0.004, 4


class LagWatch:
    """Follows a lag [s] over strides.

    Parameters
    ----------
    usual_s
        The lag of people whose channels are in time.
    most_s
        By how much it may differ from that.
    """

    def __init__(self, usual_s: float, most_s: float) -> None:
        self._usual_s = usual_s
        self._most_s = most_s
        self._newest: deque[float] = deque(maxlen=STRIDES)
        self._own: list[float] = []
        self._lag_s = self._own_s = 0.0  # medians of these
        self._run: deque[float] = deque(maxlen=SLOPE_STRIDES)

    def add(self, lag_s: float | None) -> None:
        """Add a stride's lag, None where it has none."""
        if lag_s is None:
            return
        self._newest.append(lag_s)
        self._run.append(lag_s)
        self._lag_s = median(self._newest)
        if len(self._own) < OWN_STRIDES:
            self._own.append(lag_s)
            self._own_s = median(self._own)

    @property
    def is_off(self) -> bool:
        """Whether the channel is out of time, or has drifted since the first strides."""
        if not self._newest:
            return False
        if abs(self._lag_s - self._usual_s) > self._most_s:
            return True
        return abs(self.moved_s) > DRIFT_MAX_S or self._runs_away()

    @property
    def moved_s(self) -> float:
        """By how much the lag has changed since the first strides [s]; 0 until there are enough."""
        return self._lag_s - self._own_s if len(self._own) == OWN_STRIDES else 0.0

    def _runs_away(self) -> bool:
        """Return whether the lag has changed steadily over the newest strides."""
        lags, count = self._run, len(self._run)
        if count < SLOPE_LEAST or not abs(lags[-1] - lags[0]) > SLOPE_MOVED_S / 2:
            return False
        middle, mean_s = (count - 1) / 2, sum(lags) / count
        spread = count * (count * count - 1) / 12  # of the strides' numbers
        slope = sum((n - middle) * lag_s for n, lag_s in enumerate(lags)) / spread
        if not abs(slope) * (count - 1) > SLOPE_MOVED_S:
            return False
        rest = sum((lag_s - mean_s - slope * (n - middle)) ** 2 for n, lag_s in enumerate(lags))
        scatter = (SCATTER_WEIGHT * SCATTER_S**2 + rest) / (SCATTER_WEIGHT + count - 2)
        return slope * slope * spread > SLOPE_ERRORS**2 * scatter


class BrakingFinder:
    """Finds when the ankle brakes hardest after a terminal contact.

    Parameters
    ----------
    search_s
        Where to look, in seconds after terminal contact.
    """

    def __init__(self, search_s: tuple[float, float] = SEARCH_S) -> None:
        self._search_s = search_s
        self._grid = np.arange(-round(AROUND_S * GRID_HZ), round(AROUND_S * GRID_HZ) + 1) / GRID_HZ
        self._first, last = np.searchsorted(self._grid, search_s).tolist()
        # Filter and derivatives are linear: one matrix takes a wave to its braking in the search.
        units = ZeroPhaseFilter(CUTOFF_HZ, GRID_HZ).smooth(np.eye(len(self._grid)))
        bent = [-differentiate(differentiate(unit, GRID_HZ), GRID_HZ) for unit in units]
        self._bend = np.ascontiguousarray(np.array(bent).T[self._first : last])

    def find(self, time_s: Floats, angle_rad: Floats, end_s: float) -> float | None:
        """Return the seconds from terminal contact to the hardest braking, None without one.

        Parameters
        ----------
        time_s, angle_rad
            Around the terminal contact, shape (n,).
        end_s
            The terminal contact.
        """
        if not is_finite(angle_rad):
            known = np.isfinite(angle_rad)
            time_s, angle_rad = time_s[known], angle_rad[known]
        first_s, last_s = (end_s + at_s for at_s in self._search_s)
        first_s, last_s = first_s - SETTLE_S, last_s + SETTLE_S
        if len(time_s) < 10 or time_s.item(0) > first_s or time_s.item(-1) < last_s:
            return None
        wave = np.interp(end_s + self._grid, time_s, angle_rad)
        return self.find_in_wave(wave)

    def find_in_wave(self, wave: Floats) -> float | None:
        """Return the same for an angle around terminal contact, at the times of the grid."""
        braking: Floats = self._bend @ wave
        peak = int(braking.argmax())
        if peak in (0, len(braking) - 1) or braking.item(peak) < DECELERATION_MIN_RAD_S2:
            return None
        place, _ = interpolate_peak(braking, peak)
        at_s: float = self._grid.item(0) + (self._first + place) / GRID_HZ
        return at_s


def find_moment_lag(force_n: Floats, moment_nm: Floats, rate_hz: float) -> float | None:
    """Return by how much later than the force the moment falls to half of its peak [s].

    Parameters
    ----------
    force_n, moment_nm
        From their late peaks to terminal contact, shape (n,).
    rate_hz
        Of the samples.
    """
    falls = [_find_fall(values) for values in (moment_nm, force_n)]
    if falls[0] is None or falls[1] is None:
        return None
    return (falls[0] - falls[1]) / rate_hz


def _find_fall(values: Floats) -> float | None:
    """Return where values fall below half of their peak for the last time, in samples."""
    if len(values) < 4:
        return None
    half = HALF * find_maximum(values)
    if half <= 0:
        return None
    at = find_last(values > half)
    if at < 0 or at + 1 == len(values):
        return float(at) if at >= 0 else None
    value, after = values[at : at + 2].tolist()
    beyond: float = (value - half) / (value - after)
    return at + beyond
