"""Paths: the turns and straight drives by which a base comes from one pose to the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot.motion.limits import Limits, min_time_s
from robot.motion.pose import Pose, wrap

ALIKE_M = 0.01  # how far apart two ways may be to count as the same [m]


@dataclass(frozen=True, slots=True)
class Turn:
    """Turn on the spot to a heading from home [rad]; ``by_rad`` is the planned angle."""

    heading_rad: float
    by_rad: float

    def min_duration_s(self, limits: Limits) -> float:
        """Return the shortest time that it takes [s]."""
        return min_time_s(
            self.by_rad, limits.w_rad_s, limits.speed_up_rad_s2, limits.slow_down_rad_s2
        )


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive straight to a place, heading [rad] along the line; backwards where ``by_m`` < 0."""

    x_m: float
    y_m: float
    heading_rad: float
    by_m: float

    def min_duration_s(self, limits: Limits) -> float:
        """Return the shortest time that it takes [s]."""
        return min_time_s(self.by_m, limits.v_m_s, limits.speed_up_m_s2, limits.slow_down_m_s2)


Segment = Turn | Drive


def plan_path(start: Pose, waypoint: Pose) -> tuple[Segment, ...]:
    """Return the turns and the drive that lead from one pose to another.

    The base turns to face the place, drives there and turns to the waypoint's heading. A place that
    lies behind is driven to backwards, so that a base that went out comes back the way it went.
    A turn by 0 is a segment too: following it corrects the heading.

    Parameters
    ----------
    start
        Where the base is.
    waypoint
        Where it is to come to; its heading may be more than a full turn away.
    """
    segments: list[Segment] = []
    heading_rad = start.heading_rad
    distance_m = start.distance_m(waypoint)
    if distance_m > 0:
        bearing_rad = math.atan2(waypoint.y_m - start.y_m, waypoint.x_m - start.x_m)
        ahead_rad = wrap(bearing_rad - heading_rad)
        is_behind = abs(ahead_rad) > math.pi / 2
        face_rad = wrap(ahead_rad + math.pi) if is_behind else ahead_rad
        heading_rad += face_rad
        segments.append(Turn(heading_rad, face_rad))
        by_m = -distance_m if is_behind else distance_m
        segments.append(Drive(waypoint.x_m, waypoint.y_m, heading_rad, by_m))
    segments.append(Turn(waypoint.heading_rad, waypoint.heading_rad - heading_rad))
    return tuple(segments)


def is_on_path(start: Pose, end: Pose, ways: Sequence[tuple[Pose, Pose]]) -> bool:
    """Return whether a straight way lies on others.

    Parameters
    ----------
    start, end
        The way; looked at in steps of ``ALIKE_M``.
    ways
        Starts and ends of the others, which may cover it in parts.
    """
    count = math.ceil(start.distance_m(end) / ALIKE_M)
    for index in range(count + 1):
        share = index / count if count else 0.0
        x_m = start.x_m + share * (end.x_m - start.x_m)
        y_m = start.y_m + share * (end.y_m - start.y_m)
        if not any(_beside_m(x_m, y_m, *way) <= ALIKE_M for way in ways):
            return False
    return True


def _beside_m(x_m: float, y_m: float, start: Pose, end: Pose) -> float:
    """Return the distance of a place from a straight way [m]."""
    along_x, along_y = end.x_m - start.x_m, end.y_m - start.y_m
    length2 = along_x**2 + along_y**2
    along = ((x_m - start.x_m) * along_x + (y_m - start.y_m) * along_y) / length2 if length2 else 0
    along = min(max(along, 0.0), 1.0)
    return math.hypot(x_m - start.x_m - along * along_x, y_m - start.y_m - along * along_y)
