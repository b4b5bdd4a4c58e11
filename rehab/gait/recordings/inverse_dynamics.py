"""What a leg's markers come to: for labs that send force plates and markers, but no kinetics.

In the sagittal plane, sample by sample, without a filter: the same streamed and from a file. The
foot's own weight and inertia are left out (0.03 N·m/kg in swing, where the moment is taken as
zero).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rehab.gait.recordings.column_mapping import MARKED, MEDIAL, REQUIRED
from rehab.gait.signals.filters import Floats
from rehab.gait.stances.kinetics import compute_ankle_moment

# The joint lies half an ankle's width beside its lateral malleolus, on an axis that points back:
# 6 to 28 mm ahead of it as Plug-in Gait computed it, 13 in the middle (five legs of three people).
JOINT_AHEAD_M = 0.012


def add_computed(leg: dict[str, Floats]) -> None:
    """Add to a leg's channels what is not among them and follows from its markers.

    Its ankle's moment and angle, where it has all of ``MARKED`` and not both; where its foot is, by
    the ankle; and the knee's angle, where there is a hip.

    Parameters
    ----------
    leg
        By channel, shape (n,) each; positions by one frame of reference, whose height is zero on
        the plates [m].
    """
    if leg.keys() >= set(MARKED) and not leg.keys() >= set(REQUIRED):
        leg["moment"], leg["angle"] = compute_ankle(leg)
    if not leg.keys() >= {"ankle_forward", "ankle_up"}:
        return
    ankle_x, ankle_z = _find_joint(leg)
    if "position" not in leg:
        leg["position"], leg["foot_up"] = ankle_x, ankle_z
    thigh = ("hip_forward", "hip_up", "knee_forward", "knee_up")
    if "knee_angle" not in leg and leg.keys() >= set(thigh):
        hip_x, hip_z, knee_x, knee_z = (leg[name] for name in thigh)
        upper, lower = (hip_x - knee_x, hip_z - knee_z), (knee_x - ankle_x, knee_z - ankle_z)
        leg["knee_angle"] = _find_turn(upper, lower)


def compute_ankle(leg: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return the ankle's moment [Nm] and angle [rad], shape (n,), plantarflexion positive.

    The angle is that between the shank, from the ankle to the knee, and the foot, from there to the
    toe (the head of the second metatarsal, or the middle between that and the fifth; the fifth is
    20 ms off); its zero is arbitrary, as A2 takes its velocity alone.

    Parameters
    ----------
    leg
        The channels ``MARKED``, shape (n,) each: vertical and forward force on the foot [N], the
        forward center of pressure and the markers' forward and upward positions [m], all by one
        frame of reference, whose height is zero on the plates. With ``MEDIAL``, the joint is in the
        middle between both malleoli; a joint center is sent as both.
    """
    up_n, forward_n, cop_m, _, ankle_z, knee_x, knee_z, toe_x, toe_z = (
        np.asarray(leg[name], dtype=np.float64) for name in MARKED
    )
    ankle_x, ankle_z = _find_joint(leg)
    ahead_m = 0.0 if leg.keys() >= set(MEDIAL) else JOINT_AHEAD_M
    moment = compute_ankle_moment(forward_n, up_n, cop_m, ankle_x + ahead_m, ankle_z)
    shank, foot = (knee_x - ankle_x, knee_z - ankle_z), (toe_x - ankle_x, toe_z - ankle_z)
    return moment, _find_turn(shank, foot)


def _find_joint(leg: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return the forward and upward position of the ankle, the middle of both malleoli if known."""
    x, z = (np.asarray(leg[f"ankle_{way}"], dtype=np.float64) for way in ("forward", "up"))
    if leg.keys() >= set(MEDIAL):
        x, z = (x + leg[MEDIAL[0]]) / 2, (z + leg[MEDIAL[1]]) / 2
    return x, z


def _find_turn(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> Floats:
    """Return by how much a direction, forward and upward, is turned against another one [rad]."""
    (x0, z0), (x1, z1) = first, second
    angle: Floats = np.arctan2(x1 * z0 - z1 * x0, x0 * x1 + z0 * z1)
    return angle
