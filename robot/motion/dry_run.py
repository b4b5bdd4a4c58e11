"""A gesture tried on paper: by the player that plays it, on a base that does what it is told."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from robot.motion.gesture import TETHER_M, Gesture
from robot.motion.gesture_errors import BadGesture, Marked
from robot.motion.gesture_spec import parse_gesture
from robot.motion.limits import DEFAULT_LIMITS, TICK_S, Limits
from robot.motion.player import DONE, Player
from robot.motion.pose import HOME, Pose, advance

# Where it has to end [m, rad] (kobuki.md 5.3 asks for 1 cm and 2°; a player is nearer than that).
END_M = 0.01
END_RAD = 0.035


@dataclass(frozen=True, slots=True)
class DryRun:
    """How it went: the outcome, the time it took [s], and where the base was at every tick."""

    outcome: str
    took_s: float
    way: tuple[Pose, ...]

    @property
    def farthest_m(self) -> float:
        """How far from home it has been [m]."""
        return max(pose.distance_m(HOME) for pose in self.way)


def dry_run(gesture: Gesture, limits: Limits = DEFAULT_LIMITS, pace: float = 1.0) -> DryRun:
    """Play a gesture from home to its end; parameters are those of the player."""
    player, pose, time_s, way = Player(limits), HOME, 0.0, [HOME]
    player.start(gesture, time_s, pose, pace=pace)
    while player.is_busy:  # each of its waypoints has an end, reached or not
        pose = advance(pose, player.step(time_s, pose), TICK_S)
        time_s += TICK_S
        way.append(pose)
    return DryRun(player.outcome, time_s, tuple(way))


def validate_gesture(data: Any, limits: Limits = DEFAULT_LIMITS) -> Gesture:
    """Read a composed gesture and try it. Raises BadGesture, with the cure, for one that fails."""
    gesture = parse_gesture(data)
    _check_trial(gesture, limits)
    return gesture


@lru_cache(maxsize=64)  # it comes with every cue, and a trial takes some 20 ms
def _check_trial(gesture: Gesture, limits: Limits) -> None:
    trial = dry_run(gesture, limits)
    if trial.farthest_m > TETHER_M:
        raise BadGesture(
            "Simulated, it goes {far:.2f} m from home, past the tether of {tether:g} m. Make it "
            "smaller.",
            far=trial.farthest_m,
            tether=TETHER_M,
        )
    end = trial.way[-1]
    away_m, off_rad = end.distance_m(HOME), end.turn_rad(HOME)
    if trial.outcome != DONE or away_m > END_M or off_rad > END_RAD:
        raise BadGesture(
            "Simulated, it ends after {took:.1f} s, {far:.2f} m from home ({outcome}). Give its "
            "steps more time, or make them smaller.",
            took=trial.took_s,
            far=away_m,
            outcome=Marked(trial.outcome),
        )
