"""A lab's moments and angles by those that its own plates and markers come to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from statistics import median

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import Stride

# By how much larger than ours, of five legs of three people (gaitalytics, BTK's two): a moment of
# a stance 0.95 to 1.06 times (0.11 Nm/kg beside it is where a model has its joint), an angle in its
# second half 0.90 to 1.20 times by joint centers (by lateral markers alone up to 1.43 times). And
# by how much later [s]: these moments -4 to 2 ms, these angles -3 to 9 ms.
USUAL_GAIN = {"moment": (0.88, 1.12), "angle": (0.85, 1.25)}
USUAL_LAG_S = {"moment": (-0.0075, 0.005), "angle": (-0.006, 0.0125)}
LAGS_S = np.arange(-60, 61) / 1000
GRID_S = 0.005
GAIN_CURES = {
    "moment": "Check its unit, its gain and the body mass: A2 is off by as much.",
    "angle": "Models of the foot differ so, and A2 by as much. Compare it with a foot that is held "
    "at a known angle.",
}
LAG_CURE = "Look at how the two are synchronized: A2 changes by about 1.4 % a millisecond."


def compare_with_own(
    columns: Mapping[str, Floats],
    time_s: Floats,
    legs: Mapping[str, LegSamples],
    strides: Sequence[Stride],
) -> dict[tuple[str, str], str]:
    """Return which moments and angles are not those of plates and markers, by size or time.

    By side and channel, in words.

    Parameters
    ----------
    columns
        By name; ``own.left_moment_nm``, ``own.left_angle_rad`` and the right leg's are compared,
        where there; angles where ``own.left_hip_up_m`` is, as then joint centers are known.
    time_s, legs, strides
        As measured with the columns that are proposed.
    """
    found = {}
    for (side, leg), (channel, (least, most)) in product(legs.items(), USUAL_GAIN.items()):
        is_moment = channel == "moment"
        own = columns.get(f"own.{side}_{'moment_nm' if is_moment else 'angle_rad'}")
        theirs = np.asarray(leg.moment_nm if is_moment else leg.angle_rad)
        has_centers = is_moment or f"own.{side}_hip_up_m" in columns
        if own is None or not has_centers or np.array_equal(own, theirs, equal_nan=True):
            continue
        stances = [
            (one.initial_contact_s, one.terminal_contact_s) for one in strides if one.side == side
        ]
        late = [((begin_s + end_s) / 2, end_s) for begin_s, end_s in stances]
        gain = _find_median(_find_gain, time_s, own, theirs, stances if is_moment else late)
        lag_s = _find_median(_find_lag, time_s, own, theirs, late)
        told = []
        if gain is not None and not least <= gain <= most:
            told.append(
                f"The {side} {channel} is {gain:.2f} times what the file's plates and markers come "
                f"to. {GAIN_CURES[channel]}"
            )
        earliest_s, latest_s = USUAL_LAG_S[channel]
        if lag_s is not None and not earliest_s <= lag_s <= latest_s:
            order = "later" if lag_s > 0 else "earlier"
            told.append(
                f"The {side} {channel} comes {1000 * abs(lag_s):.0f} ms {order} than the file's "
                f"plates and markers make it. {LAG_CURE}"
            )
        if told:
            found[side, channel] = " ".join(told)
    return found


def _find_median(
    find: Callable[[Floats, Floats, Floats, tuple[float, float]], float | None],
    time_s: Floats,
    own: Floats,
    channel: Floats,
    spans_s: Sequence[tuple[float, float]],
) -> float | None:
    """Return the median of what is found in several times, None where in none."""
    found = [one for span_s in spans_s if (one := find(time_s, own, channel, span_s)) is not None]
    return median(found) if found else None


def _find_lag(
    time_s: Floats, own: Floats, channel: Floats, span_s: tuple[float, float]
) -> float | None:
    """Return by how much a channel comes later than our own over a time [s], by the most alike."""
    at_s = np.arange(*span_s, GRID_S)
    moved_s = at_s + LAGS_S[:, np.newaxis]
    if len(at_s) < 10 or moved_s.min() < time_s[0] or moved_s.max() > time_s[-1]:
        return None
    ours, theirs = np.interp(at_s, time_s, own), np.interp(moved_s, time_s, channel)
    ours, theirs = ours - ours.mean(), theirs - theirs.mean(axis=1, keepdims=True)
    sizes = np.linalg.norm(theirs, axis=1)
    if not (np.isfinite(ours).all() and np.isfinite(sizes).all() and sizes.min() > 0):
        return None
    return float(LAGS_S[(theirs @ ours / sizes).argmax()])


def _find_gain(
    time_s: Floats, own: Floats, channel: Floats, span_s: tuple[float, float]
) -> float | None:
    """Return a channel by our own over a time, beside an offset; None where some is missing."""
    part = slice(*np.searchsorted(time_s, span_s))
    ours, theirs = own[part], channel[part]
    if len(ours) < 10 or not np.isfinite(ours + theirs).all() or not np.ptp(ours) > 0:
        return None
    return float(np.polyfit(ours, theirs, 1)[0])
