"""A gesture tried on paper: by the player that plays it, on a base that does what it is told."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from robot.composed import read_gesture
from robot.gestures import TETHER_M, BadGesture, Gesture, Marked
from robot.motion import DEFAULT_LIMITS, HOME, TICK_S, Limits, Pose, advance
from robot.player import DONE, Player

# Where it has to end [m, rad] (docs/reference/kobuki.md#beside-a-person asks for 1 cm and 2°; a
# player is nearer than that).
END_M = 0.01
END_RAD = 0.035


@dataclass(frozen=True, slots=True)
class Trial:
    """How it went: the outcome, the time it took [s], and where the base was at every tick."""

    outcome: str
    took_s: float
    way: tuple[Pose, ...]

    @property
    def farthest_m(self) -> float:
        """How far from home it has been [m]."""
        return max(pose.distance_m(HOME) for pose in self.way)


def try_gesture(gesture: Gesture, limits: Limits = DEFAULT_LIMITS, pace: float = 1.0) -> Trial:
    """Play a gesture from home to its end; parameters are those of the player."""
    player, pose, time_s, way = Player(limits), HOME, 0.0, [HOME]
    player.start(gesture, time_s, pose, pace=pace)
    while player.is_busy:  # each of its goals has an end, reached or not
        pose = advance(pose, player.step(time_s, pose), TICK_S)
        time_s += TICK_S
        way.append(pose)
    return Trial(player.outcome, time_s, tuple(way))


def admit_gesture(data: Any, limits: Limits = DEFAULT_LIMITS) -> Gesture:
    """Read a composed gesture and try it. Raises BadGesture, with the cure, for one that fails."""
    gesture = read_gesture(data)
    _check_trial(gesture, limits)
    return gesture


@lru_cache(maxsize=64)  # it comes with every cue, and a trial takes some 20 ms
def _check_trial(gesture: Gesture, limits: Limits) -> None:
    trial = try_gesture(gesture, limits)
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
