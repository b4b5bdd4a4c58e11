"""Whether a stance can have been one: the limits of people and of their sensors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rehab.gait.filters import Floats
from rehab.gait.kinetics import PushOff
from rehab.gait.samples import ANGLE, MOMENT, TIME
from rehab.gait.strides import Reason

GAP_S = 0.05  # bridged by a straight line up to here (gait.md 2.1)
STANCE_MIN_S = 0.2
STANCE_MAX_S = 2.2  # 0.3 m/s after a stroke: strides of up to 2.5 s with 75-80 % stance
RATE_TOLERANCE = 0.2
# A force that falls from half the body weight to nothing in 20 ms was cut off: unloading takes
# 110 ms and more (Moore 2013: half the weight is left 50 ms before terminal contact).
CUT_S = 0.02
CUT_SHARE = 0.5
FORCE_MAX = 2.0  # of body weight; fast walking reaches 1.5
# One value for so long is no measurement. The moment changes all through stance; the angle rests
# where the ankle turns, but not to the last digit.
FROZEN_S = {MOMENT: 0.02, ANGLE: 0.04}
# Nm/kg. Healthy people reach 0.8-2.0 (gait.md 6), after a stroke 0.3; a fast runner 3.5.
MOMENT_MIN = 0.05
MOMENT_MAX = 3.5
MOMENT_SWING = 0.4  # of the stance's peak, at any moment of the swing before
MOMENT_DRIFT = 0.08  # Nm/kg, for most of that swing; the foot's weight alone gives 0.03
LEVER_MAX_M = 0.3  # moment by force in late stance: ankle to toes are 0.16 (moore2013) to 0.23
LEVER_FROM = 0.7  # of stance
LEVER_FORCE = 0.15  # of body weight
MOMENT_JUMP = (0.15, 40.0)  # Nm/kg at once, and Nm/kg/s; walking reaches 20
# rad. A stiff ankle in an orthosis moves by 0.05, a free one by 0.4-0.6 in stance.
ANGLE_RANGE_MIN = 0.02
ANGLE_RANGE_MAX = 1.6
ANGLE_JUMP = (0.05, 15.0)  # rad at once, and rad/s; walking reaches 8
# A spike bends a channel more than a walker can: change of slope × time step [rad, Nm/kg] above
# what motion does at this rate (times dt²) and what the channel's noise does (times its median).
# Largest found where nothing was wrong: 0.02 rad and 0.12 Nm/kg at 100 Hz (moore2013).
BEND = {MOMENT: (0.08, 400.0, 10.0), ANGLE: (0.025, 60.0, 8.0)}
BEND_PART = (0.3, 0.95)  # of stance; at its ends the force plate's threshold bends the moment
VELOCITY_JUMP = (5.0, 400.0)  # rad/s, where velocities are sent
A2_MAX = 12.0  # W/kg: 2 Nm/kg at 6 rad/s
PEAK_FROM = 0.6  # of stance. Push-off peaks at 0.88-0.90 of it; what peaks earlier is none
REVERSED_SHARE = 0.5  # of the peak; an ankle that pushed does not brake so much before it leaves
# A foot that leaves the floor has been plantarflexing, or resting, to the last.
BACKWARD_RAD_S = 0.5
BACKWARD_S = 0.04


def check_samples(
    window: Floats, stance: int, rate_hz: float, mass_kg: float, is_velocity: bool
) -> list[Reason]:
    """Give what is wrong with the samples of a stance, before anything is measured from them.

    Parameters
    ----------
    window
        Shape (channels, n): time, force, moment, angle, …; the stance begins at sample ``stance``.
    """
    steps = window[: ANGLE + 1, stance + 1 :] - window[: ANGLE + 1, stance:-1]
    low, high = steps.min(axis=1).tolist(), steps.max(axis=1).tolist()
    if not low[TIME] > 0:
        return [Reason.TIME_BACKWARDS]
    reasons = []
    gap = high[TIME]
    if gap > max(GAP_S, 2.5 / rate_hz):
        reasons.append(Reason.GAP)
    else:
        taken_s = float(window[TIME, -1] - window[TIME, stance])
        ratio = (window.shape[1] - 1 - stance) / (taken_s * rate_hz)
        if abs(ratio - 1) > RATE_TOLERANCE:
            reasons.append(Reason.RATE)
    for row, scale, (at_once, by_time), reason in (
        (MOMENT, mass_kg, MOMENT_JUMP, Reason.MOMENT_LOST),
        (ANGLE, 1.0, VELOCITY_JUMP if is_velocity else ANGLE_JUMP, Reason.ANGLE_LOST),
    ):
        time, values = window[TIME, stance:], window[row, stance:]
        if not np.isfinite(high[row] - low[row]):  # some are missing
            known = np.flatnonzero(np.isfinite(values))
            if _has_hole(time, known):
                reasons.append(reason)
                continue
            time, values = time[known], values[known]
        limit = scale * (at_once + by_time * max(gap, 1 / rate_hz))
        jump = float(np.abs(values[1:] - values[:-1]).max())
        is_bent = not (is_velocity and row == ANGLE) and _is_bent(time, values, row, scale)
        if jump > limit or is_bent or _is_frozen(values, FROZEN_S[row] * rate_hz):
            reasons.append(reason)
    return reasons


def check_force(force_n: Floats, peak_n: float, weight_n: float, rate_hz: float) -> list[Reason]:
    """Give what is wrong with the vertical force of a stance, shape (n,), contact to contact."""
    reasons = []
    tail = force_n[-max(2, round(CUT_S * rate_hz) + 1) : -1]
    if not np.isfinite(force_n).all() or (len(tail) and tail[0] > CUT_SHARE * weight_n):
        reasons.append(Reason.FORCE_LOST)
    if peak_n > FORCE_MAX * weight_n:
        reasons.append(Reason.FORCE_TOO_LARGE)
    return reasons


def check_lever(
    time_s: Floats,
    force_n: Floats,
    moment_nm: Floats,
    begin_s: float,
    end_s: float,
    weight_n: float,
) -> list[Reason]:
    """Give what is wrong with a moment beside the force that it should come from, shape (n,)."""
    first, last = np.searchsorted(time_s, (begin_s + LEVER_FROM * (end_s - begin_s), end_s))
    force, moment = force_n[first:last], moment_nm[first:last]
    loaded = force > LEVER_FORCE * weight_n
    if loaded.any() and float((moment[loaded] / force[loaded]).max()) > LEVER_MAX_M:
        return [Reason.MOMENT_OUT_OF_STEP]
    return []


def check_push_off(
    push_off: PushOff, begin_s: float, end_s: float, is_velocity: bool
) -> list[Reason]:
    """Give what is wrong with a measured push-off in a stance from ``begin_s`` to ``end_s``."""
    reasons = []
    grid, power = push_off.time_s, push_off.power_w_kg
    begin = int(np.searchsorted(grid, begin_s))
    end = push_off.end + 1
    moment = push_off.moment_nm_kg[begin:end]
    highest, lowest = float(moment.max()), float(moment.min())
    if highest < -lowest:
        reasons.append(Reason.MOMENT_SIGN)
    elif highest < MOMENT_MIN:
        reasons.append(Reason.MOMENT_TOO_SMALL)
    elif highest > MOMENT_MAX:
        reasons.append(Reason.MOMENT_TOO_LARGE)
    swing = push_off.moment_nm_kg[: int(np.searchsorted(grid, begin_s - 0.03))]
    if len(swing):
        swing = np.abs(swing)
        middle = len(swing) // 2
        usual = float(np.partition(swing, middle)[middle])
        if usual > MOMENT_DRIFT or float(swing.max()) > MOMENT_SWING * highest:
            reasons.append(Reason.MOMENT_IN_SWING)
    reasons += _check_motion(push_off, begin, end, is_velocity)
    peak_w_kg = push_off.a2_w_kg
    share = (push_off.a2_time_s - begin_s) / (end_s - begin_s)
    if peak_w_kg <= 0 or share < PEAK_FROM or push_off.peak >= push_off.end:
        reasons.append(Reason.NO_PUSH_OFF)
    elif float(power[push_off.peak : end].min()) < -REVERSED_SHARE * peak_w_kg:
        reasons.append(Reason.POWER_REVERSED)
    if not peak_w_kg <= A2_MAX:
        reasons.append(Reason.OUT_OF_BOUNDS)
    return reasons


def _check_motion(push_off: PushOff, begin: int, end: int, is_velocity: bool) -> list[Reason]:
    velocity = push_off.velocity_rad_s
    reasons = []
    if is_velocity:
        moved = float(np.abs(velocity[begin:end]).max()) / 10  # by a swing of 0.1 s
    else:
        travel = np.cumsum(velocity[begin:end]) * (push_off.time_s[1] - push_off.time_s[0])
        moved = float(travel.max() - travel.min())
    if moved < ANGLE_RANGE_MIN:
        reasons.append(Reason.ANGLE_FLAT)
    elif moved > ANGLE_RANGE_MAX:
        reasons.append(Reason.ANGLE_TOO_LARGE)
    last = np.searchsorted(push_off.time_s, push_off.time_s[push_off.end] - BACKWARD_S)
    if float(velocity[last : push_off.end + 1].min()) < -BACKWARD_RAD_S:
        reasons.append(Reason.ANGLE_OUT_OF_STEP)
    return reasons


def _has_hole(time_s: Floats, known: NDArray[np.intp]) -> bool:
    """Say whether more is missing than may be bridged, given the indices of what is known."""
    if len(known) < 2 or known[-1] < len(time_s) - 1:
        return True
    holes = np.diff(time_s[known]).max()
    return bool(max(holes, time_s[known[0]] - time_s[0]) > GAP_S)


def _is_bent(time_s: Floats, values: Floats, row: int, scale: float) -> bool:
    """Say whether a channel has a spike or a step in the part of stance that counts."""
    count = len(values)
    part = slice(int(BEND_PART[0] * count), int(BEND_PART[1] * count))
    time_s, values = time_s[part], values[part]
    if len(values) < 5:
        return False
    spacing = time_s[1:] - time_s[:-1]
    slope = (values[1:] - values[:-1]) / spacing
    between = np.minimum(spacing[1:], spacing[:-1])
    bend = np.abs(slope[1:] - slope[:-1]) * between
    usual = float(np.partition(bend, len(bend) // 2)[len(bend) // 2])
    at_once, by_time, by_noise = BEND[row]
    return bool((bend - by_time * scale * between**2).max() > scale * at_once + by_noise * usual)


def _is_frozen(values: Floats, longest: float) -> bool:
    """Say whether a channel repeats one value, not zero, for more than so many samples."""
    still = values[1:] == values[:-1]
    if not still.any():
        return False
    still &= values[1:] != 0
    edges = np.concatenate(([-1], np.flatnonzero(~still), [len(still)]))
    return bool(np.diff(edges).max() - 1 >= max(2, longest))
