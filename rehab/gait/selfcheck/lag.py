"""By how much the kinematics come later than the force, estimated from walking itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.signals.filters import Floats, ZeroPhaseFilter, differentiate, interpolate_peak
from rehab.gait.strides import Stride

# A foot that has left the floor stops plantarflexing: the ankle brakes hardest 51 ms after terminal
# contact (moore2013, shown to be in time by its authors: 52.7 ms left, 49.2 ms right). The peak
# moves with an injected lag to 0.3 ms; between people it is taken to differ by 8 ms.
DECELERATION_S = 0.051
PERSON_TOLERANCE_S = 0.008
DECELERATION_MIN_RAD_S2 = 20.0  # below, there is no push-off to stop
SEARCH_S = (-0.05, 0.15)
AROUND_S = 0.4
GRID_HZ = 200.0
CUTOFF_HZ = 8.0
STRIDES_MIN = 10


def find_deceleration_peak(
    t_s: ArrayLike, angle_rad: ArrayLike, strides: Sequence[Stride]
) -> float | None:
    """Return when the ankle's plantarflexion brakes hardest, in seconds after terminal contact.

    From the median of the angle around all terminal contacts, filtered at 8 Hz without delay.

    Parameters
    ----------
    t_s, angle_rad
        Times [s] and ankle angles [rad], shape (n,); samples that are not finite are left out.
    strides
        Of this leg. Only their terminal contacts are used, whether or not A2 could be measured.

    Returns
    -------
    None with fewer than ten strides, or where the ankle does not brake by 20 rad/s² or more.
    """
    time, angle = np.asarray(t_s, dtype=np.float64), np.asarray(angle_rad, dtype=np.float64)
    known = np.isfinite(time) & np.isfinite(angle)
    time, angle = time[known], angle[known]
    if len(time) < 2 or not (np.diff(time) > 0).all():
        return None
    ends = np.array([stride.terminal_contact_s for stride in strides])
    ends = ends[(ends - AROUND_S > time[0]) & (ends + AROUND_S < time[-1])]
    if len(ends) < STRIDES_MIN:
        return None
    grid = np.arange(-round(AROUND_S * GRID_HZ), round(AROUND_S * GRID_HZ) + 1) / GRID_HZ
    waves = np.interp(ends[:, np.newaxis] + grid, time, angle)
    wave = np.median(waves - waves.mean(axis=1, keepdims=True), axis=0)
    smooth: Floats = ZeroPhaseFilter(CUTOFF_HZ, GRID_HZ).smooth(wave[np.newaxis])[0]
    braking = -differentiate(differentiate(smooth, GRID_HZ), GRID_HZ)
    first, last = np.searchsorted(grid, SEARCH_S).tolist()
    peak = first + int(braking[first:last].argmax())
    if peak in (first, last - 1) or braking[peak] < DECELERATION_MIN_RAD_S2:
        return None
    place, _ = interpolate_peak(braking, peak)
    return float(grid[0] + place / GRID_HZ)
