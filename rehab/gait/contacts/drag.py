"""Initial and terminal contact of a foot that drags over the floor, by the slope of the force.

The reference is docs/reference/gait.md#contacts.
"""

from __future__ import annotations

import numpy as np

from rehab.gait.signals.filters import Floats, average, find_upper_median, is_finite

# A foot that leaves unloads by 1 N/ms and more, and one that lands is loaded as fast; dragged, its
# force rests.
REST_S = 0.06  # both halves of which are the same
REST_N = 8.0
LEVEL_S = 0.06  # over which the force of a drag is taken
# A foot that is dragged only while it swings bears less when it leaves and when it lands; how long
# it falls below the drag, by how much, and over what the plate's noise is averaged.
DIP_N, DIP_S, QUIET_S = 16.0, 0.06, 0.005
SLOPE_N = 30.0  # over which the slope before the drag is taken
BEYOND_S = 0.03  # at most that it is continued
HIDDEN = 0.4  # of the drag, above which a foot's own force is taken to end


def find_edge(
    force_n: Floats, rate_hz: float, zero_n: float, release_n: float, least_n: float
) -> float | None:
    """Return where a foot leaves that is dragged on, None where nothing drags it.

    Where the force dips below the drag, that is where it crosses the release threshold, or would
    soon. Else the drag hides the end of unloading, and may have begun before it or after it: the
    slope is continued to between both (docs/reference/gait.md#contacts).

    Parameters
    ----------
    force_n
        From when it is too small for a contact, shape (n,). Of a foot that lands, in reverse.
    rate_hz
        Of the samples.
    zero_n, release_n
        The plate's zero, and the threshold above it [N].
    least_n
        The least force above the zero that is taken for a drag [N].

    Returns
    -------
    In samples from the first one.
    """
    width = max(2, round(REST_S / 2 * rate_hz))
    level = round(LEVEL_S * rate_hz)
    if len(force_n) < 2 * width:
        return None
    # Where a drag rests, half of the samples exceed the least one.
    if 2 * np.count_nonzero(force_n >= zero_n + least_n) < min(level, 2 * width):
        return None
    if not is_finite(force_n):
        return None
    mean = average(force_n, width)
    rests = np.abs(mean[:-width] - mean[width:]) < REST_N
    first = int(rests.argmax())
    if not rests[first]:
        return None
    level_n = find_upper_median(force_n[first : first + level])
    if level_n - zero_n < least_n:
        return None
    quiet = average(force_n, max(1, round(QUIET_S * rate_hz)))
    middle = (len(force_n) - len(quiet)) / 2
    fallen = int((quiet <= level_n + REST_N).argmax())
    last = max(0, fallen - 1)
    slope = _find_slope(quiet[: last + 1])
    if not slope:  # of few samples
        last, slope = fallen, _find_slope(quiet[: fallen + 1])
    free_n, apart = zero_n + release_n, max(1.0, QUIET_S * rate_hz)
    # It falls on as steeply, or half as steeply.
    reach = 2 * max(0.0, level_n - free_n) / slope + apart if slope > 0 else 0.0
    dip = fallen + _find_dip(quiet[fallen : fallen + 1 + round(min(reach, DIP_S * rate_hz))])
    if quiet[dip] < level_n - DIP_N:
        last = _find_last_above(quiet[: dip + 1], free_n)
        slope = _find_slope(quiet[: last + 1])
    else:
        apart = BEYOND_S * rate_hz
        free_n += HIDDEN * (level_n - zero_n)
    further = float(quiet[last] - free_n) / slope if slope > 0 else 0.0
    place = last + max(-apart, min(apart, further)) + middle
    return min(max(0.0, place), len(force_n) - 1.0)


def _find_slope(falling: Floats) -> float:
    """Return by how much values fall each time at the end, 0 where they do not."""
    last = len(falling) - 1
    before = _find_last_above(falling, float(falling[last]) + SLOPE_N)
    return float(falling[before] - falling[last]) / (last - before) if before < last else 0.0


def _find_dip(values: Floats) -> int:
    """Return where values are least before they rise again."""
    risen = values > np.minimum.accumulate(values) + REST_N
    again = int(risen.argmax())
    return int(values[: again if risen[again] else None].argmin())


def _find_last_above(values: Floats, level: float) -> int:
    """Return the index of the last value above a level, 0 without one."""
    above = np.flatnonzero(values > level)
    return int(above[-1]) if len(above) else 0
