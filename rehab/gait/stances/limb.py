"""The leg's posture in a step: trailing limb angle, knee flexion in swing, margin of stability.

Positions are forward and upward in meters, the floor at zero; a belt's motion is found from the
foot that rests on it. The reference is docs/reference/gait.md#posture.
"""

from __future__ import annotations

import math

import numpy as np

from rehab.gait.signals.buffer import LegBuffer
from rehab.gait.signals.filters import Floats, average, find_maximum, is_finite
from rehab.gait.signals.samples import FOOT_UP, HIP, HIP_UP, KNEE, POSITION, TIME

GRAVITY_M_S2 = 9.81
QUIET_S = 0.03  # peaks are of means over this time
FLAT = (0.2, 0.45)  # of stance, while the whole foot rests on the floor or belt
AROUND_S = 0.06  # of a contact, over which the hips' velocity is taken


def find_trailing_limb(leg: LegBuffer, begin: int, end: int, rate_hz: float) -> float | None:
    """Return the trailing limb angle of a stance [°], None where hip or foot are not known.

    The largest angle of the line from foot to hip before the vertical, in the second half of the
    stance, which is the samples ``begin:end``.
    """
    part = (begin + (end - begin) // 2, end)
    hip, up, foot, low = (leg.channel(row, *part) for row in (HIP, HIP_UP, POSITION, FOOT_UP))
    angle = np.arctan2(hip - foot, up - low)
    return _find_peak(angle, rate_hz) if end - begin >= 4 and is_finite(angle) else None


def find_knee_flexion(leg: LegBuffer, begin: int, end: int, rate_hz: float) -> float | None:
    """Return the largest knee flexion of a swing, the samples ``begin:end`` [°], if it is known."""
    angle = leg.channel(KNEE, begin, end)
    return _find_peak(angle, rate_hz) if end - begin >= 4 and is_finite(angle) else None


def find_belt_speed(leg: LegBuffer, begin: int, end: int) -> float | None:
    """Return how fast the belt carries a foot back that stands on it [m/s], if that is known."""
    length = end - begin
    part = (begin + int(FLAT[0] * length), begin + int(FLAT[1] * length) + 1)
    slope = _find_slope(leg.channel(TIME, *part), leg.channel(POSITION, *part))
    return None if slope is None else -slope


def find_margin(
    legs: tuple[LegBuffer, LegBuffer], index: int, foot_m: float, belt_m_s: float, rate_hz: float
) -> float | None:
    """Return the backward margin of stability at an initial contact [m], if both hips are known.

    How far the extrapolated center of mass, ``x + v / √(g / l)`` (Hof 2005), is ahead of the foot
    that lands (Hak 2013). The middle between the hips stands for the center of mass, and their
    height for the length of the pendulum.

    Parameters
    ----------
    legs
        Both legs.
    index
        The sample of the contact.
    foot_m, belt_m_s
        Where the foot lands, and how fast the belt carries it back.
    rate_hz
        Of the samples.
    """
    reach = round(AROUND_S * rate_hz)
    part = (max(legs[0].samples.first, index - reach), index + reach + 1)
    time_s = legs[0].channel(TIME, *part)
    middle_m = (legs[0].channel(HIP, *part) + legs[1].channel(HIP, *part)) / 2
    up_m = float(np.mean([leg.channel(HIP_UP, index, index + 1) for leg in legs]))
    velocity_m_s = _find_slope(time_s, middle_m)
    if velocity_m_s is None or not up_m > 0:
        return None
    center_m = float(middle_m[index - part[0]])
    return center_m + (velocity_m_s + belt_m_s) * math.sqrt(up_m / GRAVITY_M_S2) - foot_m


def _find_peak(angle_rad: Floats, rate_hz: float) -> float:
    width = min(len(angle_rad), round(QUIET_S * rate_hz))
    return math.degrees(find_maximum(average(angle_rad, width)))


def _find_slope(time_s: Floats, values: Floats) -> float | None:
    """Return by how much values rise in a second, by least squares; None where any is missing."""
    if len(values) < 3 or not is_finite(values):
        return None
    from_middle = time_s - time_s.mean()
    return float(from_middle @ values / (from_middle @ from_middle))
