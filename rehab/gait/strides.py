"""One stride as it was measured, and why it may be invalid."""

from __future__ import annotations

from enum import StrEnum
from typing import Any, NamedTuple


class GaitInputError(ValueError):
    """Input that nothing can be measured from; the message names the cure."""


class RejectionReason(StrEnum):
    """Why a stride is invalid. A stride without a reason is valid."""

    TIME_BACKWARDS = "time_backwards"  # the clock stood still or jumped back
    GAP = "gap"  # samples are lost where A2 is made, or more than can be bridged
    LATE = "late"  # samples came late where A2 is made, and moment or angle was made then
    RATE = "rate"  # samples come at another rate than the given one
    FORCE_LOST = "force_lost"  # the vertical force vanished or was not finite
    FORCE_TOO_LARGE = "force_too_large"  # more than any person bears: unit, or mass
    SHORT_STANCE = "short_stance"
    LONG_STANCE = "long_stance"  # standing
    CUT_OFF = "cut_off"  # the record ends before the foot leaves the floor
    IRREGULAR = "irregular"  # far from the usual stance: stumble, stop, both feet on one plate
    CROSS_STEP = "cross_step"  # cross-talk of the plates: the other foot stood on this one too
    WEIGHT = "weight"  # the plates do not carry this person
    MOMENT_LOST = "moment_lost"  # not finite, frozen or jumping
    MOMENT_SIGN = "moment_sign"  # plantarflexion is not positive
    MOMENT_TOO_SMALL = "moment_too_small"
    MOMENT_TOO_LARGE = "moment_too_large"
    MOMENT_IN_SWING = "moment_in_swing"  # of the other leg, out of time, or drifting
    MOMENT_OUT_OF_STEP = "moment_out_of_step"  # its lever on the force is longer than a foot
    ANGLE_LOST = "angle_lost"
    ANGLE_FLAT = "angle_flat"
    ANGLE_TOO_LARGE = "angle_too_large"  # degrees instead of radians
    ANGLE_OUT_OF_STEP = "angle_out_of_step"  # of the other leg, or out of time
    POWER_REVERSED = "power_reversed"  # the ankle brakes where it pushes: a sign is turned
    NO_PUSH_OFF = "no_push_off"
    OUT_OF_BOUNDS = "out_of_bounds"


class Flag(StrEnum):
    """What the therapist should know of a stride that is valid."""

    OFFSET = "offset"  # the plate's zero has moved by more than 15 N; taken out of the contacts
    SUPPORTED = "supported"  # a handrail or harness carries more than 5 % of the weight
    CLONUS = "clonus"  # the ankle beats in stance
    UNUSUAL_TIMING = "unusual_timing"  # the ankle brakes outside the known range; A2 is less sure
    LATE = "late"  # samples came late and were put back to when they were taken
    LOST = "lost"  # samples are missing where A2 does not notice


class Stride(NamedTuple):
    """A stance and the swing before it, complete at its terminal contact.

    Attributes
    ----------
    number
        Counts this leg's strides from 1.
    initial_contact_s, terminal_contact_s
        When the foot met and left the floor [s, the clock of the samples]; of a stride that is
        ``cut_off``, the end of the record.
    a2_w_kg, a2_time_s
        Peak ankle push-off power [W/kg] and when it was reached [s]; None where there is none. Only
        a valid stride's value may be shown.
    valid, reasons, flags
        Whether the stride counts, why not, and what the therapist should know of it.
    stance_s
        From initial to terminal contact [s].
    stride_s, swing_s
        Of the cycle that ended at this initial contact [s]; None where it was not seen whole.
    force_peak_n_kg, moment_peak_nm_kg
        Largest vertical force and plantarflexion moment of the stance, by body mass.
    a2_moment_nm_kg, a2_velocity_rad_s
        Moment and angular velocity where the power peaks.
    propulsion_n_kg
        Largest forward force of the second half of stance, if a forward force is sent.
    propulsion_impulse_n_s_kg, braking_impulse_n_s_kg
        Forward force that drives and that brakes, each summed over the stance and above 0, by body
        mass [N·s/kg], if a forward force is sent (Bowden 2006, Stroke 37:872).
    position_m
        Where the foot was at initial contact, if a position is sent [m, forward].
    offset_n
        What the plate read in swing and was taken off [N].
    late_s, lost_s
        By how much a sample of the stance came late at most [s], and the longest time without a
        sample in it, beyond the usual.
    a2_sd_w_kg
        Standard deviation of the A2 by noise, look-ahead and clock [W/kg]
        (``stances.uncertainty``).
    side
        "left" or "right" where both legs are measured, else None.
    step_s, step_length_m, step_symmetry
        From the other foot's initial contact to this one, and (this − other) / (this + other) of
        the two last step lengths.
    first_double_support_s, second_double_support_s, double_support_s
        Both feet on the floor after this initial and before this terminal contact, and both [s].
    propulsion_percent
        Propulsion impulse of this leg by that of both: of the paretic leg, paretic propulsion
        (Bowden 2006).
    stance_ratio_percent, swing_ratio_percent, step_time_ratio_percent, step_length_ratio_percent
        This leg's newest by the other's before it, 1 where both are alike (Patterson 2010, Gait
        Posture 31:241).
    trailing_limb_deg
        Largest angle of the line from foot to hip before the vertical, in late stance
        (``stances.limb``), if hip and foot are sent.
    knee_flexion_deg
        Largest knee flexion of the swing that ended at this initial contact, if it is sent.
    walking_ratio_mm_min
        Step length by cadence, of the two last steps [mm per step a minute].
    margin_m
        Backward margin of stability at initial contact, if both hips are sent. Sources of all four:
        docs/reference/gait.md#posture.
    weight_ratio
        Mean force of both plates over the cycle that ended here, by body weight.
    """

    number: int
    initial_contact_s: float
    terminal_contact_s: float
    valid: bool
    reasons: tuple[RejectionReason, ...]
    flags: tuple[Flag, ...]
    stance_s: float
    a2_w_kg: float | None = None
    a2_time_s: float | None = None
    stride_s: float | None = None
    swing_s: float | None = None
    force_peak_n_kg: float | None = None
    moment_peak_nm_kg: float | None = None
    a2_moment_nm_kg: float | None = None
    a2_velocity_rad_s: float | None = None
    propulsion_n_kg: float | None = None
    propulsion_impulse_n_s_kg: float | None = None
    braking_impulse_n_s_kg: float | None = None
    position_m: float | None = None
    offset_n: float = 0.0
    late_s: float = 0.0
    lost_s: float = 0.0
    a2_sd_w_kg: float | None = None
    side: str | None = None
    step_s: float | None = None
    step_length_m: float | None = None
    step_symmetry: float | None = None
    first_double_support_s: float | None = None
    second_double_support_s: float | None = None
    double_support_s: float | None = None
    propulsion_percent: float | None = None
    stance_ratio_percent: float | None = None
    swing_ratio_percent: float | None = None
    step_time_ratio_percent: float | None = None
    step_length_ratio_percent: float | None = None
    trailing_limb_deg: float | None = None
    knee_flexion_deg: float | None = None
    walking_ratio_mm_min: float | None = None
    margin_m: float | None = None
    weight_ratio: float | None = None


# What is judged of a whole stride, and not copied from a part of it.
_OWN_FIELDS = ("reasons", "flags")


def read_figures(*parts: object) -> dict[str, Any]:
    """Return the fields of a stride that its parts have under the same names; a part may be None.

    A figure that is added to ``Stride`` and to the part that measures it is passed on.
    """
    names = [name for name in Stride._fields if name not in _OWN_FIELDS]
    return {name: getattr(part, name) for part in parts for name in names if hasattr(part, name)}
