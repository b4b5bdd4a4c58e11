"""Whether a person can have walked a stance: physiological limits, and channels that must agree.

A limit refuses only what lies well beyond the clean strides of the *six people*: moore2013,
gaitalytics, BTK's two, OpenSim's subject01 and subject 7 of HBM's paper, five programs, 74 strides.
Each names what these reach; ``tests/gait/test_limits.py`` measures it again.
"""

from __future__ import annotations

import numpy as np

from rehab.gait.contacts.contact import Contact
from rehab.gait.signals.filters import (
    Floats,
    find_last,
    find_maximum,
    find_minimum,
    find_upper_median,
    is_finite,
)
from rehab.gait.stances.kinetics import PushOff
from rehab.gait.stances.resampling import ResampledStance
from rehab.gait.strides import RejectionReason

STANCE_MIN_S = 0.2
STANCE_MAX_S = 4.0  # 0.15 m/s after a stroke: strides of 3.4 to 5 s with 75-80 % stance
# A force that falls from half the body weight to nothing in 20 ms was cut off: 20 ms before
# terminal contact 0.15 of the weight is left at most (six people).
CUT_S = 0.02
CUT_SHARE = 0.5
FORCE_MAX = 2.0  # of body weight; 1.0-1.14 (six people), fast walking reaches 1.5
# Mean force of both plates over a cycle, by body weight (docs/reference/gait.md#bad-signals): a
# handrail takes some of it, a harness up to half; nothing adds any, so that more means a wrong
# mass, unit or plate.
SUPPORTED_BELOW = 0.95
WEIGHT_MIN, WEIGHT_MAX = 0.5, 1.1
ALONE_MAX = 0.8  # of stance; 0.5-0.72 from slow to fast walking, 1 at its change to running
# The same of one plate, where the other plate is not known: half of what two may carry and, as the
# sound leg carries more after a stroke (60 ± 7 % when standing, PMC4777057), rather more than half
# of the weight. Pounds for kilograms give 0.23.
LOAD_MIN, LOAD_MAX = 0.25, 0.75
# Nm/kg. Healthy people reach 0.8-2.0 (docs/reference/gait.md#usual-values), after a stroke 0.3; a
# fast runner 3.5.
MOMENT_MIN = 0.1  # below, the force passes within 1 cm of the ankle all through stance
MOMENT_MAX = 3.5
MOMENT_SWING = 0.4  # of the stance's peak, at any time of the swing before; 0.04 (six people)
MOMENT_DRIFT = 0.08  # Nm/kg, for most of that swing; the foot's weight alone gives 0.035 (the same)
LEVER_MAX_M = 0.3  # moment by force in late stance; ankle to toes: 0.14-0.24 (six people)
LEVER_FROM = 0.7  # of stance
LEVER_FORCE = 0.15  # of body weight
# A moment is its force times a lever, which passes over the foot steadily: when 30 % of the force
# are left it is 0.65-1.22 of that at the moment's peak (six people; 0.50 in one stride with the
# other foot on the plate). A lever that halves or doubles is another force's. A moment that comes
# 30 ms early has 0.4 to 0.7 in moore2013, one that comes 50 ms late 1.5 to 2.2.
LEAVING_SHARE = 0.3
LEVER_CHANGE = (0.45, 2.5)
# rad. A stiff ankle in an orthosis moves by 0.05, a free one by 0.31-0.61 in stance (six people).
ANGLE_RANGE_MIN = 0.02
ANGLE_RANGE_MAX = 2.5  # of degrees even a stiff ankle's 0.05 rad are 2.9
A2_MAX = 12.0  # W/kg: 2 Nm/kg at 6 rad/s
PEAK_FROM = 0.6  # of stance. Push-off peaks at 0.86-0.91 of it (six people)
# Of the peak: an ankle that pushed brakes by 0.05 of it at most before it leaves (six people).
REVERSED_SHARE = 0.5
# A foot that leaves the floor has been plantarflexing, or resting, to the last: there the ankle
# turns 0.13 to 1.96 times as fast as at A2 (six people; all plantarflex), and 0.56 to 0.89 times as
# fast as ever in stance by the markers of three others, one after a stroke, one with Parkinson's
# disease (examples of gaitkit 1.5). What turns back while it pushes is the other leg's, which rolls
# over its foot by then (0.75 and more), or 100 ms early (0.2-0.7).
BACKWARD_RAD_S = (0.05, 0.8)
BACKWARD_SHARE = 0.15  # of the velocity at A2, between these limits
BACKWARD_S = 0.04
FULL_LOAD = 0.8  # of body weight; 1.0-1.14 (six people), even slow walking reaches 95 %
CLONUS_TO = 0.8  # of stance; then the ankle pushes off
CLONUS_RAD_S, CLONUS_TURNS = 0.25, 4
SWING_S = 0.03  # before initial contact; later, the filter has some of the stance


def check_force(
    force_n: Floats, offset_n: float, peak_n: float, weight_n: float, rate_hz: float
) -> list[RejectionReason]:
    """Return what is wrong with the vertical force of a stance.

    Parameters
    ----------
    force_n
        From contact to contact [N], shape (n,).
    offset_n, peak_n, weight_n
        The plate's zero, the force's peak above it, and body weight [N].
    rate_hz
        Of the samples.
    """
    reasons = []
    tail = force_n[-round(CUT_S * rate_hz) - 1 : -1]
    is_cut = len(tail) and tail.item(0) - offset_n > CUT_SHARE * weight_n
    if is_cut or not is_finite(force_n):
        reasons.append(RejectionReason.FORCE_LOST)
    if peak_n > FORCE_MAX * weight_n:
        reasons.append(RejectionReason.FORCE_TOO_LARGE)
    return reasons


def check_load(load: float) -> list[RejectionReason]:
    """Return what is wrong with the mean force of one plate over a cycle, by body weight."""
    return [RejectionReason.WEIGHT] if load < LOAD_MIN or load > LOAD_MAX else []  # neither, if NaN


def check_carried_weight(ratio: float | None) -> list[RejectionReason]:
    """Check the mean force of both plates, by body weight; None where it is not known."""
    is_possible = ratio is None or WEIGHT_MIN <= ratio <= WEIGHT_MAX
    return [] if is_possible else [RejectionReason.WEIGHT]


def is_weight_supported(ratio: float) -> bool:
    """Return whether a handrail or harness takes part of the weight that both plates carry."""
    return WEIGHT_MIN <= ratio < SUPPORTED_BELOW


def is_alternating(first: Contact, this: Contact, second: Contact) -> bool:
    """Return whether the other foot left after this one came, and came before it left.

    A foot that is alone on the floor for longer than in walking has the other one on its plate.
    ``first``, ``second``: the other foot's contacts around this one.
    """
    alone = second.begin_index - first.end
    stance = this.end - this.begin_index
    return first.begin_index < this.begin_index and 0 < alone < ALONE_MAX * stance


def check_whole_foot(peak_n: float, weight_n: float) -> list[RejectionReason]:
    """Return what is wrong with a step over a plate, given its peak force and body weight [N].

    A foot that is half beside its plate bears less than even slow walking does.
    """
    return [RejectionReason.WEIGHT] if peak_n < FULL_LOAD * weight_n else []


def has_clonus(push_off: PushOff, stance: ResampledStance) -> bool:
    """Return whether the ankle beats in stance, as it does in clonus (5 to 8 a second).

    A walker's ankle turns back twice until push-off: after contact, and where it begins.
    """
    part = slice(stance.begin, stance.index(CLONUS_TO) + 1)
    velocity = push_off.velocity_rad_s[part]
    if _count_turns(velocity) < CLONUS_TURNS:  # without the slow ones there are no more
        return False
    return _count_turns(velocity[np.abs(velocity) > CLONUS_RAD_S]) >= CLONUS_TURNS


def _count_turns(velocity: Floats) -> int:
    rising = velocity > 0
    return int(np.count_nonzero(rising[1:] != rising[:-1]))


def check_lever(
    force_n: Floats, moment_nm: Floats, toes: int, weight_n: float
) -> list[RejectionReason]:
    """Return what is wrong with a moment, given the force that it should come from.

    Parameters
    ----------
    force_n, moment_nm
        Of the second half of stance [N above the plate's zero, Nm], shape (n,).
    toes
        From which of these samples on the toes bear the force: ``LEVER_FROM``.
    weight_n
        Body weight [N].
    """
    # Where the force is too small to tell, the moment may be anything.
    last_n = force_n[toes:]
    beyond = moment_nm[toes:] > LEVER_MAX_M * last_n
    if beyond[beyond.argmax()] and (beyond & (last_n > LEVER_FORCE * weight_n)).any():
        return [RejectionReason.MOMENT_OUT_OF_STEP]
    leaving = find_last(force_n > LEAVING_SHARE * find_maximum(force_n))
    if leaving < 0:  # there is no force, or not all of it
        return []
    lever_m = _find_lever(force_n, moment_nm, int(moment_nm.argmax()))
    last_m = _find_lever(force_n, moment_nm, leaving)
    low, high = LEVER_CHANGE
    # A moment that is not positive at its peak is refused by other checks.
    if lever_m > 0 and not low * lever_m <= last_m <= high * lever_m:
        return [RejectionReason.MOMENT_OUT_OF_STEP]
    return []


def _find_lever(force_n: Floats, moment_nm: Floats, at: int) -> float:
    """Return the lever of the force about the ankle at a sample and its neighbors [m]."""
    part = slice(max(0, at - 1), at + 2)
    moment: float = sum(moment_nm[part].tolist())
    force: float = sum(force_n[part].tolist())
    return moment / force


def check_push_off(push_off: PushOff, stance: ResampledStance) -> list[RejectionReason]:
    """Return what is wrong with the push-off of a stance."""
    reasons = []
    begin, end = stance.begin, stance.end
    highest, lowest = (
        push_off.moment_peak_nm_kg,
        find_minimum(push_off.moment_nm_kg[begin : end + 1]),
    )
    if highest < -lowest:
        reasons.append(RejectionReason.MOMENT_SIGN)
    elif highest < MOMENT_MIN:
        reasons.append(RejectionReason.MOMENT_TOO_SMALL)
    elif highest > MOMENT_MAX:
        reasons.append(RejectionReason.MOMENT_TOO_LARGE)
    swing = np.abs(push_off.moment_nm_kg[: max(0, begin - round(SWING_S * stance.rate_hz))])
    if len(swing):
        largest = find_maximum(swing)
        if largest > MOMENT_SWING * highest or (
            largest > MOMENT_DRIFT and find_upper_median(swing) > MOMENT_DRIFT
        ):
            reasons.append(RejectionReason.MOMENT_IN_SWING)
    reasons += _check_motion(push_off, stance)
    peak_w_kg = push_off.a2_w_kg
    share = (push_off.a2_time_s - stance.begin_s) / (stance.end_s - stance.begin_s)
    if peak_w_kg <= 0 or share < PEAK_FROM or push_off.peak >= end:
        reasons.append(RejectionReason.NO_PUSH_OFF)
    elif find_minimum(push_off.power_w_kg[push_off.peak : end + 1]) < -REVERSED_SHARE * peak_w_kg:
        reasons.append(RejectionReason.POWER_REVERSED)
    if not peak_w_kg <= A2_MAX:
        reasons.append(RejectionReason.OUT_OF_BOUNDS)
    return reasons


def _check_motion(push_off: PushOff, stance: ResampledStance) -> list[RejectionReason]:
    begin, end = stance.begin, stance.end
    reasons = []
    angle = push_off.angle_rad[begin : end + 1]
    moved = find_maximum(angle) - find_minimum(angle)
    if moved < ANGLE_RANGE_MIN:
        reasons.append(RejectionReason.ANGLE_FLAT)
    elif moved > ANGLE_RANGE_MAX:
        reasons.append(RejectionReason.ANGLE_TOO_LARGE)
    last = end - round(BACKWARD_S * stance.rate_hz)
    backward = -find_minimum(push_off.velocity_rad_s[last : end + 1])
    least, most = BACKWARD_RAD_S
    if backward > min(most, max(least, BACKWARD_SHARE * push_off.a2_velocity_rad_s)):
        reasons.append(RejectionReason.ANGLE_OUT_OF_STEP)
    return reasons
