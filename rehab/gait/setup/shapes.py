"""The shapes by which channels are recognized: each over one stride from contact to contact.

Curves of Winter (1991) for walking, as the synthetic walkers have them, and a knee's angle, which
labs take for an ankle's by a column too far.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from rehab.gait.signals.filters import Floats

POINTS = 100  # of a stride

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


def make_profile(time_s: Floats, values: Floats, contacts_s: Floats) -> Floats | None:
    """Return the median of a channel over strides, shape (POINTS,), None without usable ones.

    Parameters
    ----------
    time_s, values
        Shape (n,).
    contacts_s
        Initial contacts of one leg [s], increasing.
    """
    lengths = np.diff(contacts_s)
    usual = lengths[(lengths > 0.5) & (lengths < 6)]
    if not len(usual):
        return None
    middle = float(np.median(usual))
    begins = contacts_s[:-1][np.abs(lengths / middle - 1) < 0.2]
    known = np.isfinite(values)
    if len(begins) < 3 or known.sum() < POINTS:
        return None
    at_s = begins[:, np.newaxis] + _TIMES * middle
    profile: Floats = np.median(np.interp(at_s, time_s[known], values[known]), axis=0)
    return profile


def find_likeness(profile: Floats, shape: str, most_shift: int = 4) -> float:
    """Return how alike a profile is to a shape: their correlation, below 0 with the sign turned.

    Both may be shifted by a few hundredths of a stride against each other, as stances differ.
    """
    curve = SHAPES[shape] - SHAPES[shape].mean()
    centered = profile - profile.mean()
    size = float(np.linalg.norm(curve) * np.linalg.norm(centered))
    if not size > 0:
        return 0.0
    found = [
        float(np.roll(centered, shift) @ curve) / size
        for shift in range(-most_shift, most_shift + 1)
    ]
    return max(found, key=abs)
