"""The shapes by which channels are recognized: each over one stride from contact to contact.

Curves of Winter (1991) for walking, as the synthetic walkers have them, and a knee's angle, which
labs take for an ankle's by a column too far.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from rehab.gait.signals.filters import Floats

POINTS = 100  # of a stride
STANCE = 0.62  # of a stride, in the shapes
LOADED = 0.15  # of the largest force
STANCE_S = (0.2, 4.0)
STRIDES_MOST = 30  # half a minute is enough
SEEN = 0.8  # of a stride
SHIFT = 4  # hundredths of a stride
LIKE = 0.8  # correlation with a shape from which a column without a label may be that channel
NAMED_LIKE = 0.6  # and from which a shape does not contradict a label
# By how much more like a knee's than like an ankle's an angle's curve over a stride is. Ankles of
# the five people of ``stances.plausibility`` are less so, by 0.03 and more; knees of two of them
# are, by 0.14 and more. (Hips are not told: an ankle that brakes late is as like one.)
KNEE_LEAD = 0.08

_TIMES = np.arange(POINTS) / POINTS


def _curve(shares: list[float], values: list[float]) -> Floats:
    curve: Floats = np.asarray(PchipInterpolator(shares, values)(_TIMES), dtype=np.float64)
    return curve


SHAPES: dict[str, Floats] = {
    "force": _curve(
        [0, 0.02, 0.06, 0.14, 0.22, 0.31, 0.4, 0.48, 0.55, 0.59, 0.62, 1],
        [0, 0.16, 0.5, 1, 0.86, 0.76, 0.85, 1, 0.7, 0.25, 0, 0],
    ),
    "moment": _curve(
        [0, 0.03, 0.08, 0.19, 0.34, 0.48, 0.53, 0.57, 0.6, 0.62, 1],
        [0, -0.03, -0.08, 0.18, 0.6, 1, 0.88, 0.42, 0.1, 0, 0],
    ),
    # Plantarflexion is positive: it begins with contact and ends soon after the foot has left.
    "angle": _curve(
        [0, 0.07, 0.2, 0.4, 0.48, 0.58, 0.67, 0.78, 0.9, 1],
        [0, 0.25, -0.2, -0.55, -0.6, 0.3, 1, 0.35, -0.05, 0],
    ),
    "forward": _curve([0, 0.13, 0.31, 0.52, 0.6, 0.62, 1], [0, -0.9, 0, 1, 0.2, 0, 0]),
    "knee angle": _curve(
        [0, 0.14, 0.38, 0.5, 0.62, 0.73, 0.85, 0.96, 1],
        [0.05, 0.3, 0.08, 0.2, 0.65, 1, 0.6, 0, 0.05],
    ),
    "hip angle": _curve([0, 0.1, 0.3, 0.52, 0.7, 0.85, 1], [0.95, 0.9, 0.4, 0, 0.5, 1, 0.95]),
}


@dataclass(frozen=True, slots=True)
class Stances:
    """A leg's stances: when each begins and ends, and when the next one begins [s], shape (n,)."""

    begin_s: Floats
    end_s: Floats
    next_s: Floats

    def __len__(self) -> int:
        return len(self.begin_s)


def find_stances(time_s: Floats, force: Floats) -> Stances:
    """Return when a force bears somebody, of stances that are seen whole.

    Parameters
    ----------
    time_s, force
        Shape (n,), upward positive, of any unit.
    """
    known = np.nan_to_num(force)
    high = float(known.max(initial=0.0))
    high = float(np.percentile(known[known > 0.2 * high], 98)) if high > 0 else 0.0
    loaded = np.concatenate(([False], known > LOADED * high, [False])) if high > 0 else np.zeros(2)
    edges = np.flatnonzero(loaded[1:] != loaded[:-1]).reshape(-1, 2)
    whole = edges[(edges[:, 0] > 0) & (edges[:, 1] < len(time_s))]
    begin_s, end_s = time_s[whole[:, 0]], time_s[whole[:, 1] - 1]
    usual = (end_s - begin_s > STANCE_S[0]) & (end_s - begin_s < STANCE_S[1])
    begin_s, end_s = begin_s[usual], end_s[usual]
    after_s = end_s + (end_s - begin_s) * (1 - STANCE) / STANCE
    next_s = np.append(begin_s[1:], np.inf)
    is_next = (next_s - end_s > 0.1) & (next_s - begin_s < 3 * (end_s - begin_s))
    return Stances(begin_s, end_s, np.where(is_next, next_s, after_s))


def make_profile(time_s: Floats, values: Floats, stances: Stances) -> Floats | None:
    """Return the median of a channel over strides, shape (POINTS,), None without usable ones.

    Stances are stretched to one length, and swings to another, as people differ in their shares.

    Parameters
    ----------
    time_s, values
        Shape (n,).
    stances
        Of one leg.
    """
    known = np.isfinite(values)
    if known.sum() < POINTS / 2:
        return None
    most = slice(0, STRIDES_MOST)
    ends = (stances.begin_s[most], stances.end_s[most], stances.next_s[most])
    begin_s, end_s, next_s = (times[:, np.newaxis] for times in ends)
    in_stance = begin_s + _TIMES / STANCE * (end_s - begin_s)
    in_swing = end_s + (_TIMES - STANCE) / (1 - STANCE) * (next_s - end_s)
    at_s = np.where(_TIMES < STANCE, in_stance, in_swing)
    if not known.all():
        time_s, values = time_s[known], values[known]
    seen = np.interp(at_s, time_s, values, left=np.nan, right=np.nan)
    seen = seen[np.isfinite(seen).mean(axis=1) > SEEN]
    if not len(seen):
        return None
    profile: Floats = np.nanmedian(seen, axis=0) if len(seen) > 1 else seen[0]
    return np.where(np.isfinite(profile), profile, np.nanmedian(profile))


def find_likeness(profile: Floats) -> dict[str, float]:
    """Return how alike a profile is to each shape: their correlation, below 0 with the sign turned.

    Both may be shifted by a few hundredths of a stride against each other, as stances differ.
    """
    centered = profile - profile.mean()
    size = float(np.linalg.norm(centered))
    if not 0 < size < np.inf:
        return dict.fromkeys(SHAPES, 0.0)
    found = (_SHIFTED @ centered) / size
    best = found[np.arange(len(SHAPES)), np.abs(found).argmax(axis=1)]
    return dict(zip(SHAPES, best.tolist(), strict=True))


_CURVES = np.array([curve - curve.mean() for curve in SHAPES.values()])
_SHIFTED = np.array([np.roll(_CURVES, shift, axis=1) for shift in range(-SHIFT, SHIFT + 1)])
_SHIFTED = np.swapaxes(_SHIFTED, 0, 1) / np.linalg.norm(_CURVES, axis=1)[:, np.newaxis, np.newaxis]
