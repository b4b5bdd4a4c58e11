"""Poses of a base, and its motion where nothing slips.

Right-handed, as in ROS (REP 103): x ahead, y to the left, headings counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.motion.twist import Twist


@dataclass(frozen=True, slots=True)
class Pose:
    """A place [m] and a heading [rad]. Headings add up over full turns, and never jump."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    @property
    def is_finite(self) -> bool:
        """Whether all three numbers are finite."""
        return all(map(math.isfinite, (self.x_m, self.y_m, self.heading_rad)))

    def distance_m(self, other: Pose) -> float:
        """Return the distance between two places [m]."""
        return math.hypot(other.x_m - self.x_m, other.y_m - self.y_m)

    def turn_rad(self, other: Pose) -> float:
        """Return the angle between two headings [rad], 0 to π; full turns do not count."""
        return abs(wrap(other.heading_rad - self.heading_rad))

    def seen_from(self, origin: Pose) -> Pose:
        """Return this pose in the frame of another: its x axis is that one's heading."""
        x_m, y_m = self.x_m - origin.x_m, self.y_m - origin.y_m
        cos, sin = math.cos(origin.heading_rad), math.sin(origin.heading_rad)
        return Pose(
            x_m * cos + y_m * sin, y_m * cos - x_m * sin, self.heading_rad - origin.heading_rad
        )


HOME = Pose()


def wrap(angle_rad: float) -> float:
    """Return the same direction [rad] within ±π."""
    return math.remainder(angle_rad, math.tau)


def advance(pose: Pose, twist: Twist, elapsed_s: float) -> Pose:
    """Return where a base is after a time at one twist, if nothing slips.

    Parameters
    ----------
    pose
        Where it is before.
    twist
        Its velocity, held throughout.
    elapsed_s
        The time [s].

    Returns
    -------
    Pose
        The end of an exact circular arc, not of an Euler step.
    """
    turn_rad = twist.w_rad_s * elapsed_s
    # The chord of the arc: its length is that of the arc times sin(half)/half, along the mean
    # heading.
    half_rad = turn_rad / 2
    straight = math.sin(half_rad) / half_rad if abs(half_rad) > 1e-9 else 1.0
    chord_m, aside_m = (speed * elapsed_s * straight for speed in (twist.v_m_s, twist.vy_m_s))
    along_rad = pose.heading_rad + half_rad
    cos, sin = math.cos(along_rad), math.sin(along_rad)
    return Pose(
        pose.x_m + chord_m * cos - aside_m * sin,
        pose.y_m + chord_m * sin + aside_m * cos,
        pose.heading_rad + turn_rad,
    )
