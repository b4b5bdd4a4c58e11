"""A lab's moments by those that its own plates and markers come to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import Stride

# A stance's moment is 0.95 to 1.03 times that of plates and markers (gaitalytics, BTK's; offsets
# up to 0.11 Nm/kg are where a model has its joint). Angles are 0.94 to 1.07 times ours in three of
# five legs and 1.26 to 1.43 in two, whose models turn the joint otherwise: no gain of them is told.
USUAL_GAIN = (0.88, 1.12)


def compare_with_own(
    columns: Mapping[str, Floats],
    time_s: Floats,
    legs: Mapping[str, LegSamples],
    strides: Sequence[Stride],
) -> list[str]:
    """Return which moments are not those of the file's plates and markers, by their size.

    Parameters
    ----------
    columns
        By name; ``own.left_moment_nm`` and ``own.right_moment_nm`` are compared, where there.
    time_s, legs, strides
        As measured with the columns that are proposed.
    """
    found = []
    for side, leg in legs.items():
        own = columns.get(f"own.{side}_moment_nm")
        moment = np.asarray(leg.moment_nm)
        if own is None or np.array_equal(own, moment, equal_nan=True):
            continue
        gains = [_find_gain(time_s, own, moment, one) for one in strides if one.side == side]
        known = [gain for gain in gains if gain is not None]
        if known and not USUAL_GAIN[0] <= median(known) <= USUAL_GAIN[1]:
            found.append(
                f"The {side} moment is {median(known):.2f} times what the file's plates and "
                "markers come to. Check its unit, its gain and the body mass: A2 is off by as much."
            )
    return found


def _find_gain(time_s: Floats, own: Floats, moment: Floats, stride: Stride) -> float | None:
    """Return a moment by our own over a stance, beside an offset; None where some is missing."""
    ends_s = (stride.initial_contact_s, stride.terminal_contact_s)
    part = slice(*np.searchsorted(time_s, ends_s))
    ours, theirs = own[part], moment[part]
    if len(ours) < 10 or not np.isfinite(ours + theirs).all() or not np.ptp(ours) > 0:
        return None
    return float(np.polyfit(ours, theirs, 1)[0])
