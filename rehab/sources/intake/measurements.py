"""Strides of ``rehab.gait`` as measurements, which a source sends."""

from __future__ import annotations

import math

from rehab.gait import Stride, WearableStride
from rehab.gait.wearables import VERSION
from rehab.training.measures import WORN
from rehab.training.steps import Measurement, Side
from robot.wire.limits import MAX_REASONS

# Figures that are sent with a step beside its A2, named as in ``rehab.gait.strides.Stride``.
EXTRA = (
    *("initial_contact_s", "stance_s", "swing_s", "stride_s", "step_s"),
    *("first_double_support_s", "second_double_support_s"),
    *("double_support_s", "step_length_m", "step_symmetry"),
    *(
        "stance_ratio_percent",
        "swing_ratio_percent",
        "step_time_ratio_percent",
        "step_length_ratio_percent",
    ),
    *(
        "propulsion_n_kg",
        "propulsion_impulse_n_s_kg",
        "braking_impulse_n_s_kg",
        "propulsion_percent",
    ),
    *("force_peak_n_kg", "moment_peak_nm_kg", "a2_moment_nm_kg", "a2_velocity_rad_s"),
    "a2_sd_w_kg",
    *("trailing_limb_deg", "knee_flexion_deg", "walking_ratio_mm_min", "margin_m"),
    *("weight_ratio", "offset_n"),
)


def from_wearable(
    side: Side, stride: WearableStride, asymmetry_percent: float | None, number: int
) -> Measurement:
    """Return a stride by a worn sensor as a measurement: figures of its own, without an A2.

    Measures train one of them by their channel. It ends with the initial contact after it:
    its contacts follow from ``stride_s`` and ``stance_s``.
    """
    place = stride.place
    stance_percent = 100 * stride.stance_share
    extra = {
        WORN[place]: VERSION,
        "stride_s": stride.stride_s,
        "stance_s": stride.stance_s,
        "cadence_min": stride.cadence_min,
        f"{place}_stance_percent": stance_percent,
        f"{place}_swing_percent": 100 - stance_percent,
        "step_asymmetry_percent": asymmetry_percent,
        "foot_strike_deg": _to_degrees(stride.foot_strike_rad),
        "push_off_deg_s": _to_degrees(stride.push_off_rad_s),
        "shank_lean_deg": _to_degrees(stride.shank_lean_rad),
        "sensor_rate_hz": stride.rate_hz,
    }
    return Measurement(
        number=number,
        time_s=stride.end_s,
        side=side,
        value=None,
        reasons=tuple(str(reason) for reason in stride.reasons),
        extra={name: float(value) for name, value in extra.items() if value is not None},
    )


def _to_degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None else math.degrees(angle_rad)


def to_measurement(stride: Stride, number: int, side: Side) -> Measurement | None:
    """Return a stride as a measurement: A2 at its terminal contact, other figures as extras.

    ``side`` is for strides whose leg is not named. None for a stride without a finite time.
    """
    time_s = stride.terminal_contact_s
    if not math.isfinite(time_s):
        return None
    value = stride.a2_w_kg
    extra = {name: getattr(stride, name) for name in EXTRA}
    extra |= {f"flag_{flag}": 1.0 for flag in stride.flags}
    return Measurement(
        number=number,
        time_s=time_s,
        side=side if stride.side is None else Side(stride.side),
        value=None if value is None or not math.isfinite(value) else value,
        reasons=tuple(str(reason) for reason in stride.reasons[:MAX_REASONS]),
        extra={
            name: float(number)
            for name, number in extra.items()
            if number is not None and math.isfinite(number)
        },
    )
