"""When the ankle brakes after the foot has left, from walking itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.stances.lag_watch import AROUND_S, GRID_HZ, BrakingFinder
from rehab.gait.strides import Stride

SEARCH_S = (-0.1, 0.2)
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
    return BrakingFinder(SEARCH_S).find_in_wave(wave)
