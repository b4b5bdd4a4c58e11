"""A lab's moments and angles by those that its own plates and markers come to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from statistics import median

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import Stride

# By how much larger than ours, of five legs of three people (gaitalytics, BTK's two): a moment of
# a stance 0.95 to 1.06 times (0.11 Nm/kg beside it is where a model has its joint), an angle in its
# second half 0.90 to 1.20 times by joint centers (by lateral markers alone up to 1.43 times).
USUAL_GAIN = {"moment": (0.88, 1.12), "angle": (0.85, 1.25)}
CURES = {
    "moment": "Check its unit, its gain and the body mass: A2 is off by as much.",
    "angle": "Models of the foot differ so, and A2 by as much. Compare it with a foot that is held "
    "at a known angle.",
}


def compare_with_own(
    columns: Mapping[str, Floats],
    time_s: Floats,
    legs: Mapping[str, LegSamples],
    strides: Sequence[Stride],
) -> dict[tuple[str, str], str]:
    """Return which moments and angles are not those of plates and markers, by their size.

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
        spans = [
            (
                one.initial_contact_s + (0.0 if is_moment else one.stance_s / 2),
                one.terminal_contact_s,
            )
            for one in strides
            if one.side == side
        ]
        gains = [_find_gain(time_s, own, theirs, span) for span in spans]
        known = [gain for gain in gains if gain is not None]
        if known and not least <= median(known) <= most:
            found[side, channel] = (
                f"The {side} {channel} is {median(known):.2f} times what the file's plates and "
                f"markers come to. {CURES[channel]}"
            )
    return found


def _find_gain(
    time_s: Floats, own: Floats, channel: Floats, span_s: tuple[float, float]
) -> float | None:
    """Return a channel by our own over a time, beside an offset; None where some is missing."""
    part = slice(*np.searchsorted(time_s, span_s))
    ours, theirs = own[part], channel[part]
    if len(ours) < 10 or not np.isfinite(ours + theirs).all() or not np.ptp(ours) > 0:
        return None
    return float(np.polyfit(ours, theirs, 1)[0])
