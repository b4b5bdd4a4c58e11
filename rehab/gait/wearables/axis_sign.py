"""Which end of the axis about which a leg swings points to the walker's left."""

from __future__ import annotations

from collections.abc import Sequence

from rehab.gait.wearables.axis import SagittalAxis
from rehab.gait.wearables.doubtful_strides import Reading

STRIDES_MIN, STRIDES_SURE = 3, 5  # of a sign that may be right; of the one with more of them
# A leg moves less in the middle of a stance than in what is taken for one with the wrong sign; by
# half where travel does not say where ahead is, which counts only about a certain axis.
QUIETER, QUIETER_ALONE = 0.9, 0.5


def find_sign(readings: Sequence[Reading], axis: SagittalAxis) -> Reading | None:
    """Return the reading of the samples, one for each sign, that the strides so far confirm.

    Two signs must not disagree: where the leg travels, and that it is quiet in its stances.
    """
    if max(one.count for one in readings) < STRIDES_SURE:
        return None
    known = [one for one in readings if one.count >= STRIDES_MIN]
    quiet = min(known, key=lambda one: one.motion_rad_s)
    other = next(one for one in readings if one is not quiet)
    ahead = axis.left_sign
    if ahead not in (None, quiet.sign):
        return None
    if ahead is None and (len(known) < 2 or not axis.is_sure):
        return None
    limit = QUIETER_ALONE if ahead is None else QUIETER
    is_quieter = quiet.motion_rad_s <= other.motion_rad_s * limit
    return quiet if quiet.is_plausible and is_quieter else None
