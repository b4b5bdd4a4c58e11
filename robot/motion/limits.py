"""Limits of place, speed and acceleration, and the times that orders to a base keep to."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.motion.twist import STILL, Twist

TICK_S = 0.02  # between two orders to a base: 50 Hz, the rate of a Kobuki's feedback

# A base never leaves this circle around its home [m]; gestures keep 5 cm away from its edge
# (docs/reference/kobuki.md#beside-a-person).
TETHER_M = 0.30
REACH_M = 0.25
# Further from home than this [m, rad] a gesture is refused, and one that ends there has failed
# (docs/reference/kobuki.md#beside-a-person).
AT_HOME_M = 0.05
AT_HOME_RAD = 0.087  # 5°

# A limiter counts at most this between two orders [s]: a program that hung must not make a base
# lurch
# (docs/reference/kobuki.md#orders).
LONGEST_STEP_S = 0.1

# A base stands still by itself when its last order is older than this [s]: it may have no firmware
# watchdog, and the program that gave the order may hang (docs/reference/kobuki.md#orders).
ORDER_HOLDS_S = 0.25

# No limits may be set above these: a base of 7 kg stops within 9 cm from 0.2 m/s, and a Kobuki's
# gyro is calibrated up to 1.75 rad/s (docs/reference/kobuki.md#beside-a-person).
CEILING_M_S = 0.30
CEILING_RAD_S = 1.8


@dataclass(frozen=True, slots=True)
class Limits:
    """How fast a base may go, and how quickly it may change that.

    Parameters
    ----------
    v_m_s, w_rad_s
        Largest speeds [m/s, rad/s], the first one in any direction. Default: the original's 0.2
        m/s; 1.5 rad/s, within what a Kobuki's gyro is calibrated for (the original's 1.8 is not).
    speed_up_m_s2, slow_down_m_s2
        Largest changes of that velocity [m/s²]. Default: a Kobuki's smoother and driver.
    speed_up_rad_s2, slow_down_rad_s2
        Largest changes of ``w`` [rad/s²]. Default: the same.

    Raises
    ------
    ValueError
        For numbers that are not above 0, and for speeds above the ceilings.

    Notes
    -----
    Sources of the defaults: docs/reference/kobuki.md#beside-a-person. Slowing down may be quicker
    than speeding up, so that a stop is quick.
    """

    v_m_s: float = 0.20
    w_rad_s: float = 1.5
    speed_up_m_s2: float = 0.3
    slow_down_m_s2: float = 0.5
    speed_up_rad_s2: float = 2.5
    slow_down_rad_s2: float = 3.5

    def __post_init__(self) -> None:
        straight = (self.speed_up_m_s2, self.slow_down_m_s2)
        turning = (self.speed_up_rad_s2, self.slow_down_rad_s2)
        if not all(0 < rate < math.inf for rate in (*straight, *turning)):
            raise ValueError("Accelerations are finite numbers above 0.")
        if not (0 < self.v_m_s <= CEILING_M_S and 0 < self.w_rad_s <= CEILING_RAD_S):
            raise ValueError(
                f"Speeds lie above 0 and up to {CEILING_M_S:g} m/s and {CEILING_RAD_S:g} rad/s."
            )

    def scaled(self, share: float) -> Limits:
        """Return limits with this share of all speeds and accelerations.

        Raises ValueError for a share that is not above 0 and up to 1.
        """
        if not 0 < share <= 1:
            raise ValueError("A share of the limits lies above 0 and up to 1.")
        return replace(
            self, **{name: getattr(self, name) * share for name in Limits.__dataclass_fields__}
        )

    def clip(self, twist: Twist) -> Twist:
        """Return a twist within the speeds, on the same curve; ``STILL`` where not finite."""
        if not twist.is_finite:
            return STILL
        too_fast = max(twist.speed_m_s / self.v_m_s, abs(twist.w_rad_s) / self.w_rad_s, 1.0)
        return Twist(twist.v_m_s / too_fast, twist.w_rad_s / too_fast, twist.vy_m_s / too_fast)

    def approach(self, now: Twist, wanted: Twist, elapsed_s: float) -> Twist:
        """Return what may be ordered next, on the way from one twist to another.

        Parameters
        ----------
        now
            What was ordered last.
        wanted
            What is wanted; clipped first.
        elapsed_s
            Time since the last order [s]; counted from 0 to ``LONGEST_STEP_S``.
        """
        elapsed_s = min(max(elapsed_s, 0.0), LONGEST_STEP_S) if math.isfinite(elapsed_s) else 0.0
        wanted = self.clip(wanted)
        more_m_s, less_m_s = self.speed_up_m_s2 * elapsed_s, self.slow_down_m_s2 * elapsed_s
        w_rad_s = _ramp(
            now.w_rad_s,
            wanted.w_rad_s,
            self.speed_up_rad_s2 * elapsed_s,
            self.slow_down_rad_s2 * elapsed_s,
        )
        if not (now.vy_m_s or wanted.vy_m_s):
            return Twist(_ramp(now.v_m_s, wanted.v_m_s, more_m_s, less_m_s), w_rad_s)
        v_m_s, vy_m_s = _ramp_way(
            (now.v_m_s, now.vy_m_s), (wanted.v_m_s, wanted.vy_m_s), more_m_s, less_m_s
        )
        return Twist(v_m_s, w_rad_s, vy_m_s)


DEFAULT_LIMITS = Limits()


def _ramp(now: float, wanted: float, more: float, less: float) -> float:
    """Return the speed nearest to the wanted one that a change by ``more`` or ``less`` can reach.

    A speed that turns round comes to 0 first, and speeds up from there in the next order.
    """
    if now * wanted < 0:
        wanted = 0.0
    if abs(wanted) >= abs(now):
        return math.copysign(min(abs(wanted), abs(now) + more), wanted)
    return math.copysign(max(abs(wanted), abs(now) - less), now)


def _ramp_way(
    now: tuple[float, float], wanted: tuple[float, float], more: float, less: float
) -> tuple[float, float]:
    """Return the same for a velocity ahead and to the left, whose change has any direction."""
    if now[0] * wanted[0] + now[1] * wanted[1] < 0:
        wanted = (0.0, 0.0)
    change = (wanted[0] - now[0], wanted[1] - now[1])
    may_change = more if math.hypot(*wanted) >= math.hypot(*now) else less
    share = min(1.0, may_change / math.hypot(*change)) if any(change) else 0.0
    return now[0] + share * change[0], now[1] + share * change[1]


def min_time_s(distance: float, speed: float, speed_up: float, slow_down: float) -> float:
    """Return the shortest time from rest to rest over a distance [s].

    Parameters
    ----------
    distance
        The way [m] or the turn [rad]; its sign does not matter.
    speed
        Largest speed [m/s or rad/s].
    speed_up, slow_down
        Largest accelerations [m/s² or rad/s²].

    Notes
    -----
    The speed's profile is a trapezoid, or a triangle where the distance is too short to reach the
    largest speed.
    """
    distance = abs(distance)
    ramps = speed * speed / 2 * (1 / speed_up + 1 / slow_down)
    if distance >= ramps:
        return speed / speed_up + speed / slow_down + (distance - ramps) / speed
    return math.sqrt(2 * distance * (1 / speed_up + 1 / slow_down))


WHEEL_LIMITS = Limits(v_m_s=CEILING_M_S, w_rad_s=CEILING_RAD_S)  # what a base itself drives at most
