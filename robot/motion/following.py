"""Follows a segment of a path: the twist that brings a base nearer to its end."""

from __future__ import annotations

import math

from robot.motion.limits import Limits
from robot.motion.path import Drive, Segment, Turn
from robot.motion.pose import HOME, Pose, wrap
from robot.motion.twist import WHEELBASE_M, Twist

# How near to its waypoint a base has to come [m, rad] (docs/reference/kobuki.md#beside-a-person
# asks for 1 cm and 2°).
NEAR_M = 0.004
NEAR_RAD = 0.02
# Braking is planned with this share of the limits, so that an order that comes a little late is
# still in time.
BRAKING = 0.8
# Speed for each meter or radian that is left [1/s]: no overshoot in the last centimeter with orders
# every 20 ms and a base that follows within 100 ms.
CLOSING_PER_S = 8.0
# While driving: heading offset for each meter beside the line [rad/m], and its maximum [rad].
STEER_RAD_M = 2.5
STEER_MAX_RAD = 0.3


class Follower:
    """Follows segments with wheels that ignore orders below a speed.

    Parameters
    ----------
    stiction_m_s
        That speed [m/s].
    is_holonomic
        Whether the base moves sideways, too: it goes straight to the end of a segment.

    Attributes
    ----------
    creeps
        Whether its wheels follow orders so slow that it comes to its places without a jerk.
    """

    def __init__(self, stiction_m_s: float, *, is_holonomic: bool = False) -> None:
        self._is_holonomic = is_holonomic
        self._least = Twist(stiction_m_s, 2 * stiction_m_s / WHEELBASE_M)
        self.creeps = stiction_m_s <= CLOSING_PER_S * NEAR_M
        # One that does not creep comes nearer to its places in the same time.
        share = 1.0 if self.creeps else 0.5
        self._near_m, self._near_rad = NEAR_M * share, NEAR_RAD * share

    def follow(self, segment: Segment, pose: Pose, limits: Limits) -> Twist | None:
        """Return the twist that follows a segment from a pose; None at its end."""
        match segment:
            case Turn():
                left_rad = segment.heading_rad - pose.heading_rad
                if abs(left_rad) <= self._near_rad:
                    return None
                return Twist(
                    w_rad_s=_approach_speed(left_rad, limits.w_rad_s, limits.slow_down_rad_s2)
                )
            case Drive() if self._is_holonomic:
                left = Pose(segment.x_m, segment.y_m).seen_from(pose)
                away_m = left.distance_m(HOME)
                if away_m <= self._near_m:
                    return None
                share = _approach_speed(away_m, limits.v_m_s, limits.slow_down_m_s2) / away_m
                turn_rad = wrap(segment.heading_rad - pose.heading_rad)
                return Twist(share * left.x_m, turn_rad * CLOSING_PER_S / 2, share * left.y_m)
            case Drive():
                goal = Pose(segment.x_m, segment.y_m)
                left = goal.seen_from(Pose(pose.x_m, pose.y_m, segment.heading_rad))
                left_m, beside_m = left.x_m, -left.y_m
                ahead = math.copysign(1.0, segment.by_m)
                if left_m * ahead <= self._near_m:
                    return None
                # Towards the line; backwards that is by turning the other way.
                steer_rad = max(-STEER_MAX_RAD, min(STEER_MAX_RAD, STEER_RAD_M * beside_m)) * ahead
                turn_rad = wrap(segment.heading_rad - steer_rad - pose.heading_rad)
                return Twist(
                    _approach_speed(left_m, limits.v_m_s, limits.slow_down_m_s2),
                    turn_rad * CLOSING_PER_S / 2,
                )

    def lift(self, ramped: Twist, wanted: Twist) -> Twist:
        """Return an order that no wheel ignores: at its least speed, or still.

        While it drives, it is steered by as much as leaves both wheels at that speed; a holonomic
        base keeps its direction instead.

        Parameters
        ----------
        ramped
            What the limits allow now, on the way to what is wanted.
        wanted
            What is wanted.
        """
        if self._is_holonomic:
            along = ramped if ramped.speed_m_s else wanted
            to_wanted = ramped.v_m_s * wanted.v_m_s + ramped.vy_m_s * wanted.vy_m_s
            left_m_s = math.copysign(wanted.speed_m_s, to_wanted)
            lifted_m_s = _lift(ramped.speed_m_s, left_m_s, self._least.v_m_s)
            if lifted_m_s:
                share = lifted_m_s / along.speed_m_s
                return Twist(share * along.v_m_s, ramped.w_rad_s, share * along.vy_m_s)
        v_m_s = _lift(ramped.v_m_s, wanted.v_m_s, self._least.v_m_s)
        if v_m_s:
            most_rad_s = math.inf
            if self._least.v_m_s:
                most_rad_s = 2 * (abs(v_m_s) - self._least.v_m_s) / WHEELBASE_M
            return Twist(v_m_s, max(-most_rad_s, min(most_rad_s, ramped.w_rad_s)))
        return Twist(0.0, _lift(ramped.w_rad_s, wanted.w_rad_s, self._least.w_rad_s))


def _lift(ramped: float, wanted: float, least: float) -> float:
    """Return a speed of at least the least one on its way to what is wanted, or 0."""
    if abs(ramped) >= least:
        return ramped
    return math.copysign(least, wanted) if wanted and ramped * wanted >= 0 else 0.0


def _approach_speed(left: float, speed: float, slow_down: float) -> float:
    """Return a speed from which the rest of the way is long enough to brake."""
    braking = math.sqrt(2 * BRAKING * slow_down * abs(left))
    return math.copysign(min(speed, braking, CLOSING_PER_S * abs(left)), left)
