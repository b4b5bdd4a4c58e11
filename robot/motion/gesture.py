"""Gestures: places to go to, one after the other, and home again.

A gesture is defined by places and not by times: timed ones end rotated and displaced as soon as a
base accelerates gently (docs/reference/kobuki.md#timed-gestures).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

from robot.motion.gesture_errors import NOT_FINITE, BadGesture, BadWaypoint
from robot.motion.lights_and_sounds import NEUTRAL, Score
from robot.motion.limits import DEFAULT_LIMITS, REACH_M, Limits
from robot.motion.path import Drive, Segment, is_on_path, plan_path
from robot.motion.pose import HOME, Pose

# Less than this nobody sees from 2 m away [m, rad]: half a degree of the field of view, and 6°,
# which a mast or a face on the base shows (docs/robot.md). (Ours.)
VISIBLE_M = 0.02
VISIBLE_RAD = 0.1

GESTURE_MAX_S = 16.0  # the paper's longest, with slack
MAX_WAYPOINTS = 32
TURN_MAX_RAD = math.tau  # beyond this a cable winds up
# Slower turns stick and shake (docs/reference/kobuki.md#what-users-report: below 0.33 rad/s).
MIN_PACE = 0.2
SLACK = 1.5  # time of a waypoint over the shortest possible, for odometry, grip and latency


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A pose to come to, seen from home.

    Parameters
    ----------
    x_m, y_m, heading_rad
        The pose [m, m, rad]. A heading of ±2π is home again after a full turn.
    within_s
        Time that it may take [s]; a base that is not there by then stops.
    pace
        Share of the limits to go at, above 0 and up to 1.
    hold_s
        How long to stay there [s].
    """

    x_m: float
    y_m: float
    heading_rad: float
    within_s: float
    pace: float = 1.0
    hold_s: float = 0.0

    @property
    def pose(self) -> Pose:
        """The pose to come to."""
        return Pose(self.x_m, self.y_m, self.heading_rad)


@dataclass(frozen=True, slots=True)
class Gesture:
    """What a base performs: waypoints in their order, of which the last is home, and a score.

    ``least`` is the share of its size below which no answer performs it. Raises BadGesture for
    what no base with the default limits should or could perform.
    """

    name: str
    label: str
    waypoints: tuple[Waypoint, ...]
    score: Score = NEUTRAL
    least: float = 0.0

    def __post_init__(self) -> None:
        check_gesture(self)

    @property
    def reach_m(self) -> float:
        """How far from home it goes [m]."""
        return max(waypoint.pose.distance_m(HOME) for waypoint in self.waypoints)

    @property
    def turn_rad(self) -> float:
        """How far it turns, one way or the other [rad]."""
        return max(abs(waypoint.heading_rad) for waypoint in self.waypoints)

    @property
    def is_visible(self) -> bool:
        """Whether somebody who walks 2 m away sees it."""
        return self.reach_m >= VISIBLE_M - 1e-9 or self.turn_rad >= VISIBLE_RAD - 1e-9

    def scaled(self, intensity: float) -> Gesture:
        """Return the gesture at a share of its size, which never takes longer.

        Ways shrink, and turns too where it only drives on the line ahead of home. Where it drives
        aside, its turns set the direction and stay as they are. Neither shrinks below what is seen.

        Parameters
        ----------
        intensity
            The share, above 0 and up to 1.

        Raises
        ------
        BadGesture
            For any other share.
        """
        if not 0 < intensity <= 1:
            raise BadGesture("An intensity lies above 0 and up to 1.")
        ways = _share_at_least(intensity, VISIBLE_M, self.reach_m)
        turns = _share_at_least(intensity, VISIBLE_RAD, self.turn_rad)
        turns = turns if self._drives_ahead else 1.0
        waypoints = tuple(
            replace(
                waypoint,
                x_m=waypoint.x_m * ways,
                y_m=waypoint.y_m * ways,
                heading_rad=waypoint.heading_rad * turns,
            )
            for waypoint in self.waypoints
        )
        return replace(self, waypoints=waypoints)

    @property
    def _drives_ahead(self) -> bool:
        """Whether it drives with the heading of home only."""
        segments = (
            segment
            for segments, _, _ in stages(self.waypoints, DEFAULT_LIMITS)
            for segment in segments
        )
        drives = [segment for segment in segments if isinstance(segment, Drive)]
        return all(abs(drive.heading_rad) < 1e-9 for drive in drives)

    def min_duration_s(self, pace: float = 1.0) -> float:
        """Return the shortest time that it can take at a share of the default limits [s]."""
        return sum(
            hold_s + sum(segment.min_duration_s(limits) for segment in segments)
            for segments, limits, hold_s in stages(self.waypoints, DEFAULT_LIMITS, pace)
        )


def _share_at_least(share: float, least: float, size: float) -> float:
    """Return a share of a size that does not come below a least size, nor makes it larger."""
    return max(share, min(least / size, 1.0)) if size else share


def check_gesture(gesture: Gesture) -> None:
    """Check that a gesture is safe and possible within ``DEFAULT_LIMITS``.

    Raises
    ------
    BadGesture
        For too many waypoints, one out of reach, too little or too much time, an end that is not
        home, and a way that is driven backwards and was not driven forwards before (a Kobuki has no
        rear bumper). The message names the waypoint and the cure.
    """
    if not 1 <= len(gesture.waypoints) <= MAX_WAYPOINTS:
        raise BadGesture("A gesture has 1 to {most} goals.", most=MAX_WAYPOINTS)
    for number, waypoint in enumerate(gesture.waypoints, start=1):
        check_waypoint(number, waypoint)
    last = gesture.waypoints[-1].pose
    if last.distance_m(HOME) or abs(last.turn_rad(HOME)) > 1e-9:
        raise BadGesture("A gesture's last goal is home: x 0, y 0, heading 0.")
    needed_s = [needed_time_s(*stage) for stage in stages(gesture.waypoints, DEFAULT_LIMITS)]
    if sum(needed_s) > GESTURE_MAX_S:
        raise BadGesture(
            "This takes up to {took:.1f} s; a gesture takes at most {most:g} s. Make it smaller, "
            "or leave something out.",
            took=sum(needed_s),
            most=GESTURE_MAX_S,
        )
    for number, (waypoint, min_duration_s) in enumerate(
        zip(gesture.waypoints, needed_s, strict=True), start=1
    ):
        if waypoint.within_s < min_duration_s:
            raise BadWaypoint(
                number,
                "{part} {number} needs {needed:.1f} s; give it as long.",
                needed=math.ceil(10 * min_duration_s) / 10,
            )
    _check_ways_back(gesture.waypoints)


def needed_time_s(segments: Sequence[Segment], limits: Limits, hold_s: float) -> float:
    """Return the time that a waypoint needs at least [s]: its segments with slack, and its hold.

    Parameters
    ----------
    segments
        Turns and drives that lead to the waypoint.
    limits
        Speeds and accelerations at the waypoint's pace.
    hold_s
        How long it stays there [s].
    """
    return SLACK * sum(segment.min_duration_s(limits) for segment in segments) + hold_s


def check_waypoint(number: int, waypoint: Waypoint) -> None:
    """Check a waypoint by itself, whatever comes before it. Raises BadWaypoint.

    Parameters
    ----------
    number
        Its place in the gesture, from 1.
    waypoint
        The waypoint.
    """
    if not all(map(math.isfinite, astuple(waypoint))):
        raise BadWaypoint(number, NOT_FINITE)
    away_m = waypoint.pose.distance_m(HOME)
    if away_m > REACH_M:
        raise BadWaypoint(
            number,
            "{part} {number} goes {away:.2f} m away from home, further than {most:g} m. Make it "
            "shorter.",
            away=away_m,
            most=REACH_M,
        )
    if abs(waypoint.heading_rad) > TURN_MAX_RAD:
        raise BadWaypoint(
            number, "{part} {number} turns more than once around. Turn back first, or less."
        )
    if not MIN_PACE <= waypoint.pace <= 1:
        raise BadWaypoint(
            number, "{part} {number} has a pace outside {least:g} to 1.", least=MIN_PACE
        )
    if not (0 < waypoint.within_s <= GESTURE_MAX_S and 0 <= waypoint.hold_s <= waypoint.within_s):
        raise BadWaypoint(
            number,
            "{part} {number} may take up to {most:g} s, its hold included.",
            most=GESTURE_MAX_S,
        )


def _check_ways_back(waypoints: Sequence[Waypoint]) -> None:
    """Refuse a way that is driven backwards and was not driven forwards before."""
    seen: list[tuple[Pose, Pose]] = []
    start = HOME
    for number, waypoint in enumerate(waypoints, start=1):
        for segment in plan_path(start, waypoint.pose):
            if not isinstance(segment, Drive):
                continue
            if segment.by_m > 0:
                seen.append((start, waypoint.pose))
            elif not is_on_path(start, waypoint.pose, seen):
                raise BadWaypoint(
                    number,
                    "{part} {number} backs where it did not come from; there is no bumper behind. "
                    "Let it face the way, or go ahead first.",
                )
        start = waypoint.pose


def stages(
    waypoints: Sequence[Waypoint], limits: Limits, pace: float = 1.0
) -> list[tuple[tuple[Segment, ...], Limits, float]]:
    """Return each waypoint's segments from the one before, their limits, and its hold [s].

    None goes faster than at ``pace``, a share of the limits.
    """
    starts = (HOME, *(waypoint.pose for waypoint in waypoints[:-1]))
    return [
        (plan_path(start, waypoint.pose), limits.scaled(min(waypoint.pace, pace)), waypoint.hold_s)
        for start, waypoint in zip(starts, waypoints, strict=True)
    ]
