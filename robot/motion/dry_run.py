"""Dry runs of gestures: the player that plays them, on a base that follows exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from robot.marking import Marked
from robot.motion.composed_gestures import parse_gesture
from robot.motion.gesture import Gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.limits import DEFAULT_LIMITS, TETHER_M, TICK_S, Limits
from robot.motion.player import DONE, Player
from robot.motion.pose import HOME, Pose, advance

# How near to home it has to end [m, rad] (docs/reference/kobuki.md#beside-a-person asks for 1 cm
# and 2°; a player comes nearer than that).
END_M = 0.01
END_RAD = 0.035


@dataclass(frozen=True, slots=True)
class DryRun:
    """Result of a dry run: the outcome, the time it took [s], and the pose at every tick."""

    outcome: str
    took_s: float
    poses: tuple[Pose, ...]

    @property
    def farthest_m(self) -> float:
        """The largest distance from home [m]."""
        return max(pose.distance_m(HOME) for pose in self.poses)


@lru_cache(maxsize=64)  # a gesture comes with every cue, a list shows all; a run takes some 20 ms
def dry_run(gesture: Gesture, limits: Limits = DEFAULT_LIMITS, pace: float = 1.0) -> DryRun:
    """Return the result of playing a gesture from home to its end.

    Parameters
    ----------
    gesture
        What to play.
    limits
        Speeds and accelerations.
    pace
        Share of the limits to go at, at most, above 0 and up to 1.
    """
    player, pose, time_s, poses = Player(limits), HOME, 0.0, [HOME]
    player.start(gesture, time_s, pose, pace=pace)
    while player.is_busy:  # each of its waypoints has an end, reached or not
        pose = advance(pose, player.step(time_s, pose), TICK_S)
        time_s += TICK_S
        poses.append(pose)
    return DryRun(player.outcome, time_s, tuple(poses))


def validate_gesture(data: Any, limits: Limits = DEFAULT_LIMITS) -> Gesture:
    """Return the gesture that JSON data specify, once a dry run has succeeded.

    Parameters
    ----------
    data
        See ``parse_gesture``.
    limits
        Speeds and accelerations of the base that is to perform it.

    Raises
    ------
    BadGesture
        For data that are no gesture, and for one that leaves the tether (``TETHER_M``), runs out of
        time, or ends further than ``END_M`` or ``END_RAD`` from home.
    """
    gesture = parse_gesture(data)
    _check_dry_run(gesture, limits)
    return gesture


def _check_dry_run(gesture: Gesture, limits: Limits) -> None:
    result = dry_run(gesture, limits)
    if result.farthest_m > TETHER_M:
        raise BadGesture(
            "Simulated, it goes {far:.2f} m from home, past the tether of {tether:g} m. Make it "
            "smaller.",
            far=result.farthest_m,
            tether=TETHER_M,
        )
    end = result.poses[-1]
    away_m, off_rad = end.distance_m(HOME), end.turn_rad(HOME)
    if result.outcome != DONE or away_m > END_M or off_rad > END_RAD:
        raise BadGesture(
            "Simulated, it ends after {took:.1f} s, {far:.2f} m from home ({outcome}). Give its "
            "steps more time, or make them smaller.",
            took=result.took_s,
            far=away_m,
            outcome=Marked(result.outcome),
        )
