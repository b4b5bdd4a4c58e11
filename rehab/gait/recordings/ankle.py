"""An ankle's moment and angle, of labs that send force plates and markers but no inverse dynamics.

In the sagittal plane, sample by sample, without a filter: the same streamed and from a file. The
foot's own weight and inertia are left out (0.03 N·m/kg in swing, where the moment is taken as
zero).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rehab.gait.recordings.columns import MARKED
from rehab.gait.signals.filters import Floats
from rehab.gait.stances.kinetics import compute_ankle_moment

# The joint lies half an ankle's width beside its lateral malleolus, on an axis that points back:
# 0.035 m (Plug-in Gait takes half of 70 mm) by sine of 15 to 21 degrees (gaitalytics' right leg, by
# its medial marker; Isman and Inman 1969: 6 degrees to the foot, which points out by 10 to 18).
JOINT_AHEAD_M = 0.012


def compute_ankle(leg: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return the ankle's moment [Nm] and angle [rad], shape (n,), plantarflexion positive.

    The angle is that between the shank, from the lateral malleolus to the knee, and the foot, from
    there to the toe (the head of the second metatarsal, best; the fifth is 20 ms off); its zero is
    arbitrary, as A2 takes its velocity alone.

    Parameters
    ----------
    leg
        The channels ``MARKED``, shape (n,) each: vertical and forward force on the foot [N], the
        forward center of pressure and the markers' forward and upward positions [m], all by one
        frame of reference, whose height is zero on the plates.
    """
    up_n, forward_n, cop_m, *places = (np.asarray(leg[name], dtype=np.float64) for name in MARKED)
    ankle_x, ankle_z, knee_x, knee_z, toe_x, toe_z = places
    moment = compute_ankle_moment(forward_n, up_n, cop_m, ankle_x + JOINT_AHEAD_M, ankle_z)
    foot_x, foot_z = toe_x - ankle_x, toe_z - ankle_z
    shank_x, shank_z = knee_x - ankle_x, knee_z - ankle_z
    angle: Floats = np.arctan2(
        foot_x * shank_z - foot_z * shank_x, foot_x * shank_x + foot_z * shank_z
    )
    return moment, angle
