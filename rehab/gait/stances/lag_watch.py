"""Whether angle or moment comes out of time with the force, by the strides before.

Several strides show what one cannot. A moment is its force times a lever, so both fall together,
whoever walks. An ankle brakes soon after its foot has left, but people differ in that by more than
any lag that matters: it is refused only where it changes from this person's own first strides.

Who takes twice the time for a stance takes it for what happens in it, and a lag of so much longer
does the same to A2: lags are compared by the pace of ``PACE_S``.
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

# A foot that has left the floor stops plantarflexing: from when to when the ankle brakes hardest,
# after terminal contact. Of eleven people and six systems [ms]: moore2013 49 to 61; gaitalytics -2
# to 13 (treadmill), 4 to 10 (overground); BTK's two -2 to 22; OpenSim's two 27 to 35; HBM's subject
# 7 14; by markers alone (gaitkit 1.5) a person after a stroke 20 to 40, one with Parkinson's
# disease 13 to 33, a healthy one 20. The margins, 18 and 14 ms, are for people who are not among
# them. Outside, a stride is marked as unusual and stays valid: nothing proves that no person walks
# so.
BRAKING_S = (-0.02, 0.075)
PACE_S = 1.1  # a fifth more than the longest usual stance of the people of all limits here
BRAKING_MIN_RAD_S2 = 20.0  # below, there is no push-off to stop
SEARCH_S = (-0.1, 0.2)
SETTLE_S = 0.05  # of the filter
AROUND_S = 0.4
GRID_HZ = 200.0
CUTOFF_HZ = 8.0
# Moment and force fall to half of their late peaks together. Medians of six people [ms]: moore2013
# 8, gaitalytics 2, BTK's two 0 and -3, OpenSim's subject01 3, HBM's 3; simulated -11 to -3. Beyond
# 30 ms the lever of the force would have to double or halve while the foot leaves.
HALF = 0.5
MOMENT_LAG_S = (-0.03, 0.03)

# One stride is sure to 8 ms (moore2013), so medians are compared: of the newest strides, and of the
# first ones. With that scatter, walks of 200 strides that do not drift lose less than 0.1 %; fewer
# strides or a tighter limit lose up to a tenth of some walks. Who scatters more may drift more.
STRIDES, OWN_STRIDES = 5, 7
DRIFT_MAX_S = 0.02  # a steady walker's own drifts by 10 ms in a minute (moore2013)
DRIFT_SCATTERS = 3.0  # mean deviations of a person's own first strides …
DRIFT_MOST_S = 0.06  # … up to here
# A clock that runs away is seen earlier by the slope of the lag over the newest strides: five times
# its own error, by what strides scatter, which few strides tell less of than 4 ms known before.
SLOPE_STRIDES, SLOPE_LEAST = 12, 5
SLOPE_ERRORS, SLOPE_MOVED_S = 7.0, 0.01
SCATTER_S, SCATTER_WEIGHT = 0.004, 4


def find_pace(stance_s: float) -> float:
    """Return how many times as long all takes for whom a stance takes so long."""
    return max(1.0, stance_s / PACE_S)


class LagWatch:
    """Follows a lag [s] over strides.

    Parameters
    ----------
    people_s
        The least and the largest lag of people whose channels are in time.
    """

    def __init__(self, people_s: tuple[float, float]) -> None:
        self._least_s, self._most_s = people_s
        self._drift_max_s = DRIFT_MAX_S
        self._newest: deque[float] = deque(maxlen=STRIDES)
        self._own: list[float] = []
        self._lag_s = self._own_s = 0.0  # medians of these
        self._pace = 1.0
        self._run: deque[float] = deque(maxlen=SLOPE_STRIDES)

    def add(self, lag_s: float | None, stance_s: float = PACE_S) -> None:
        """Add a stride's lag, None where it has none, and how long its foot stood."""
        if lag_s is None:
            return
        self._pace = find_pace(stance_s)
        lag_s /= self._pace
        self._newest.append(lag_s)
        self._run.append(lag_s)
        self._lag_s = median(self._newest)
        if len(self._own) < OWN_STRIDES:
            self._own.append(lag_s)
            self._own_s = median(self._own)
            scatter_s = sum(abs(one_s - self._own_s) for one_s in self._own) / len(self._own)
            self._drift_max_s = min(max(DRIFT_MAX_S, DRIFT_SCATTERS * scatter_s), DRIFT_MOST_S)

    @property
    def beyond_s(self) -> float:
        """By how much the lag is outside of what is known of people [s], 0 where it is not."""
        if not self._newest:
            return 0.0
        beyond_s = min(0.0, self._lag_s - self._least_s) + max(0.0, self._lag_s - self._most_s)
        return beyond_s * self._pace

    @property
    def has_drifted(self) -> bool:
        """Whether the lag has changed since the first strides, or is changing steadily."""
        return abs(self.moved_s) > self._drift_max_s * self._pace or self._runs_away()

    @property
    def moved_s(self) -> float:
        """By how much the lag has changed since the first strides [s]; 0 until there are enough."""
        return self._pace * (self._lag_s - self._own_s) if len(self._own) == OWN_STRIDES else 0.0

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
        if peak in (0, len(braking) - 1) or braking.item(peak) < BRAKING_MIN_RAD_S2:
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
