"""State of a base that ROS drives: odometry, also below a turret, dead reckoning, hazards."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import replace

from robot.motion.limits import ORDER_HOLDS_S
from robot.motion.pose import HOME, Pose, advance, wrap
from robot.motion.twist import STILL, Twist

# From one odometry message to the next a base moves no further [m, rad], at our ceilings and with a
# second between them. Beyond that it was restarted, or another program has set its odometry.
JUMP_M, JUMP_RAD = 0.3, 1.8
# Angles of a turret that are older [s] say nothing: they come 50 times a second. The velocity of
# its body is that over the last moments [s]. (Ours.)
TURRET_SILENT_S, TURRET_SPAN_S = 0.2, 0.1


class ReportedOdometry:
    """Odometry that the base reports, seen from home; it begins at home.

    Attributes
    ----------
    pose, twist
        Where it is from home, and how it moves.
    seen_s
        When that was last reported [s].
    """

    def __init__(self) -> None:
        self.pose, self.twist, self.seen_s = HOME, STILL, -math.inf
        self._home: Pose | None = None
        self._last = HOME  # as the base reports it
        self._heading_rad = 0.0  # likewise, full turns included

    def update(self, reported: Pose, twist: Twist, now_s: float) -> bool:
        """Store a reported pose, and return whether it has jumped.

        Parameters
        ----------
        reported
            Its pose in the frame of its own odometry.
        twist
            Its velocity.
        now_s
            The time [s].
        """
        turned_rad = wrap(reported.heading_rad - self._last.heading_rad)
        jumped = self._home is not None and (
            reported.distance_m(self._last) > JUMP_M or abs(turned_rad) > JUMP_RAD
        )
        self._heading_rad += turned_rad
        self._last, self.twist, self.seen_s = reported, twist, now_s
        if self._home is None:
            self.set_home()
        self._update_pose()
        return jumped

    def set_home(self) -> None:
        """Make the present place home."""
        self._home = replace(self._last, heading_rad=self._heading_rad)
        self._update_pose()

    def move(self, now_s: float) -> None:
        """Do nothing: the base reports how it moves."""

    def order(self, twist: Twist, now_s: float) -> None:
        """Do nothing with ``twist`` at ``now_s``: the base reports how it follows."""

    def _update_pose(self) -> None:
        here = replace(self._last, heading_rad=self._heading_rad)
        self.pose = here.seen_from(self._home or HOME)


class Turret:
    """Where the body of a base is that stands on a turret, ahead of its wheels' axle.

    Such a base moves as a holonomic one: its axle turns to where the body is to go, and the turret
    turns against it. Its odometry is the axle's.

    Parameters
    ----------
    ahead_m
        From the middle of the axle to the turret's [m].
    """

    def __init__(self, ahead_m: float) -> None:
        self._ahead_m = ahead_m
        self._angle_rad, self._turned_s = 0.0, -math.inf
        self._poses: deque[tuple[float, Pose]] = deque()

    def turn(self, angle_rad: float, now_s: float) -> None:
        """Store the turret's angle from the axle's heading [rad], seen at ``now_s`` [s]."""
        self._angle_rad, self._turned_s = angle_rad, now_s

    def locate(self, axle: Pose, stamp_s: float, now_s: float) -> tuple[Pose, Twist] | None:
        """Return pose and velocity of the body; None where the turret's angle is not known.

        Parameters
        ----------
        axle
            Pose of the axle, by its odometry.
        stamp_s
            When that was, by the base's clock [s].
        now_s
            The time [s].
        """
        if now_s - self._turned_s > TURRET_SILENT_S:
            self._poses.clear()
            return None
        there = advance(axle, Twist(self._ahead_m), 1.0)
        body = replace(there, heading_rad=axle.heading_rad + self._angle_rad)
        if self._poses and not 0 < stamp_s - self._poses[-1][0] <= TURRET_SPAN_S:
            self._poses.clear()
        while self._poses and stamp_s - self._poses[0][0] > TURRET_SPAN_S:
            self._poses.popleft()
        self._poses.append((stamp_s, body))
        from_s, before = self._poses[0]
        if from_s == stamp_s:
            return body, STILL
        turned_rad = wrap(body.heading_rad - before.heading_rad)
        midway = replace(before, heading_rad=before.heading_rad + turned_rad / 2)
        moved, span_s = body.seen_from(midway), stamp_s - from_s
        return body, Twist(moved.x_m / span_s, turned_rad / span_s, moved.y_m / span_s)


class DeadReckoning:
    """Where a base without odometry is, if it does what it is sent: an open loop.

    A gesture that is played on this is a profile of speed over time, with its ramps.
    """

    def __init__(self) -> None:
        self.pose, self.twist, self.seen_s = HOME, STILL, math.inf  # nothing that could be late
        self._until_s = self._ordered_s = -math.inf

    def order(self, twist: Twist, now_s: float) -> None:
        """Store that ``twist`` was sent at ``now_s`` [s], after moving up to then."""
        self.move(now_s)
        self.twist, self._ordered_s = twist, now_s

    def move(self, now_s: float) -> None:
        """Advance its pose to the present, at most for as long as the last order holds."""
        moved_s = min(now_s, self._ordered_s + ORDER_HOLDS_S) - self._until_s
        if moved_s > 0 and not self.twist.is_still:
            self.pose = advance(self.pose, self.twist, moved_s)
        if now_s - self._ordered_s >= ORDER_HOLDS_S:
            self.twist = STILL
        self._until_s = max(self._until_s, now_s)

    def set_home(self) -> None:
        """Make the present place home."""
        self.pose = HOME


class HazardSensors:
    """Hazards: what bumpers, cliff sensors and wheels report, and what happened to it.

    Events come when something changes. Those of a lost connection are missed; the loss itself
    stops the base.
    """

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter(jumped=0)
        self._pressed: dict[str, set[int]] = {}
        self._unread: set[str] = set()

    def update(self, hazard: str, which: int, is_detected: bool) -> None:
        """Store an event of one sensor.

        Parameters
        ----------
        hazard
            The hazard's code.
        which
            Number of the sensor among those of its kind.
        is_detected
            Whether it detects the hazard now.
        """
        pressed = self._pressed.setdefault(hazard, set())
        (pressed.add if is_detected else pressed.discard)(which)
        if is_detected:
            self._unread.add(hazard)

    def replace(self, hazards: frozenset[str]) -> None:
        """Store all hazards that hold now, of a base that reports them together."""
        self._pressed = {hazard: {0} for hazard in hazards}
        self._unread |= hazards

    def record(self, hazard: str) -> None:
        """Store something that happened."""
        self._unread.add(hazard)

    def reset(self) -> None:
        """Reset what is pressed: the connection is lost."""
        self._pressed.clear()

    def hazards(self) -> frozenset[str]:
        """Return the hazards of now, and those that have not been read yet."""
        unread, self._unread = self._unread, set()
        return frozenset(unread | {name for name, on in self._pressed.items() if on})
