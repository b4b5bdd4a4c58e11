"""Wheels of a Kobuki: twists as commands, and commands as wheel speeds."""

from __future__ import annotations

import math

from robot.bases.kobuki_protocol.commands import BaseControl
from robot.motion.twist import STILL, WHEELBASE_M, Twist

# One tick of an encoder [m] (docs/reference/kobuki.md#odometry-and-gyro).
TICK_M = 8.5292090497737556558e-5
# Largest speed of a wheel [m/s] (docs/reference/kobuki.md#limits).
WHEEL_MAX_M_S = 0.70

HALF_MM = 1000 * WHEELBASE_M / 2
RADIUS_MAX_MM = 32767
ON_THE_SPOT = 1  # the radius [mm] that means a turn on the spot

STOP = BaseControl(0, 0)


def slow_to_wheels(twist: Twist) -> Twist:
    """Return a twist on the same curve with no wheel above ``WHEEL_MAX_M_S``.

    ``STILL`` for one that is not finite.

    Clipping one of the two speeds would make it another curve
    (docs/reference/kobuki.md#speed-and-radius).
    """
    if not twist.is_finite:
        return STILL
    too_fast = max(max(map(abs, twist.wheels_m_s)) / WHEEL_MAX_M_S, 1.0)
    return Twist(twist.v_m_s / too_fast, twist.w_rad_s / too_fast)


def twist_to_control(twist: Twist) -> BaseControl:
    """Return the command that comes nearest to a twist.

    Parameters
    ----------
    twist
        The velocity; one that is not finite gives the stop.

    Returns
    -------
    BaseControl
        Speed of the outer wheel [mm/s] and radius of the curve [mm].

    Notes
    -----
    The outer wheel's speed carries the sign of v, and the radius that of the turn
    (docs/reference/kobuki.md#speed-and-radius). Four things differ from the reference driver:
    curves too wide for the radius are driven straight, or on the widest, whichever is nearer;
    numbers are rounded, not truncated; too fast a twist keeps its curve; NaN and infinity never
    reach the wheels.
    """
    twist = slow_to_wheels(twist)
    v_mm_s, w_rad_s = 1000 * twist.v_m_s, twist.w_rad_s
    if abs(w_rad_s) * 2 * RADIUS_MAX_MM < abs(v_mm_s) or w_rad_s == 0:
        return BaseControl(round(v_mm_s), 0)
    # A radius that rounds to -1, 0 or 1 would be read as another curve.
    if abs(v_mm_s) < 1.5 * abs(w_rad_s):
        return BaseControl(round(HALF_MM * w_rad_s), ON_THE_SPOT)
    outer_mm_s = math.copysign(abs(v_mm_s) + HALF_MM * abs(w_rad_s), v_mm_s)
    radius_mm = max(-RADIUS_MAX_MM, min(RADIUS_MAX_MM, round(v_mm_s / w_rad_s)))
    return BaseControl(round(outer_mm_s), radius_mm)


def control_to_twist(control: BaseControl) -> Twist:
    """Return the twist that a command means, as the firmware reads it.

    Source: docs/reference/kobuki.md#speed-and-radius.
    """
    speed, radius = control
    if radius == 0:
        return Twist(speed / 1000, 0.0)
    if radius == ON_THE_SPOT:
        return Twist(0.0, speed / HALF_MM)
    w_rad_s = speed / (radius + math.copysign(HALF_MM, radius))
    return Twist(w_rad_s * radius / 1000, w_rad_s)
