"""Gestures: places to go to, one after the other, and home again.

A gesture says where, never for how long: timed ones end rotated and displaced as soon as a base
speeds up gently (kobuki.md 2.5). Here are the gestures, and the arithmetic of how one is driven.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.motion import DEFAULT_LIMITS, HOME, Limits, Pose, least_time_s, wrap

# A base never leaves this circle around its home [m]; gestures keep 5 cm away from its edge
# (kobuki.md 5.3).
TETHER_M = 0.30
REACH_M = 0.25

# How near to its goal a base has to come [m, rad] (kobuki.md 5.3 asks for 1 cm and 2°).
NEAR_M = 0.004
NEAR_RAD = 0.02

GESTURE_MAX_S = 16.0  # the paper's longest, with slack
GOALS_MAX = 32
TURN_MAX_RAD = math.tau  # a longer cable than this winds up
SLACK = 1.5  # a goal's time over its shortest possible: odometry, grip and latency cost some


class BadGesture(ValueError):
    """A gesture that a base could not perform; the message says what would be one."""


@dataclass(frozen=True, slots=True)
class Goal:
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
        """Where it is."""
        return Pose(self.x_m, self.y_m, self.heading_rad)


@dataclass(frozen=True, slots=True)
class Gesture:
    """What a base performs: goals in their order, of which the last is home.

    Raises BadGesture for what no base with the default limits should or could perform.
    """

    name: str
    label: str
    goals: tuple[Goal, ...]

    def __post_init__(self) -> None:
        check_gesture(self)

    def scaled(self, intensity: float) -> Gesture:
        """Give the gesture at this share of its size, above 0 and up to 1; never quicker."""
        if not 0 < intensity <= 1:
            raise BadGesture("An intensity lies above 0 and up to 1.")
        goals = tuple(
            replace(
                goal,
                x_m=goal.x_m * intensity,
                y_m=goal.y_m * intensity,
                heading_rad=goal.heading_rad * intensity,
            )
            for goal in self.goals
        )
        return replace(self, goals=goals)

    @property
    def least_s(self) -> float:
        """The shortest time that it can take within the default limits [s]."""
        return sum(
            hold_s + sum(leg.least_s(limits) for leg in legs)
            for legs, limits, hold_s in _stages(self.goals, DEFAULT_LIMITS)
        )


@dataclass(frozen=True, slots=True)
class Turn:
    """Turn on the spot to a heading [rad], seen from home; ``by_rad`` from where it should be."""

    heading_rad: float
    by_rad: float

    def least_s(self, limits: Limits) -> float:
        """Give the shortest time that it takes [s]."""
        return least_time_s(
            self.by_rad, limits.w_rad_s, limits.speed_up_rad_s2, limits.slow_down_rad_s2
        )


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive straight to a place, heading [rad] along the line; backwards where ``by_m`` < 0."""

    x_m: float
    y_m: float
    heading_rad: float
    by_m: float

    def least_s(self, limits: Limits) -> float:
        """Give the shortest time that it takes [s]."""
        return least_time_s(self.by_m, limits.v_m_s, limits.speed_up_m_s2, limits.slow_down_m_s2)


Leg = Turn | Drive


def plan_legs(start: Pose, goal: Pose) -> tuple[Leg, ...]:
    """Give the turns and the drive that lead from one pose to another.

    The base turns to face the place, drives there and turns to the goal's heading. A place that
    lies behind is driven to backwards, so that a base that went out comes back the way it went.
    A turn by 0 is a leg too: who follows it comes to that heading from wherever it is.
    """
    legs: list[Leg] = []
    heading_rad = start.heading_rad
    distance_m = start.distance_m(goal)
    if distance_m > 0:
        bearing_rad = math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m)
        ahead_rad = wrap(bearing_rad - heading_rad)
        is_behind = abs(ahead_rad) > math.pi / 2
        face_rad = wrap(ahead_rad + math.pi) if is_behind else ahead_rad
        heading_rad += face_rad
        legs.append(Turn(heading_rad, face_rad))
        by_m = -distance_m if is_behind else distance_m
        legs.append(Drive(goal.x_m, goal.y_m, heading_rad, by_m))
    legs.append(Turn(goal.heading_rad, goal.heading_rad - heading_rad))
    return tuple(legs)


def check_gesture(gesture: Gesture) -> None:
    """Raise BadGesture, with the cure, for a gesture that is not safe and possible."""
    if not 1 <= len(gesture.goals) <= GOALS_MAX:
        raise BadGesture(f"A gesture has 1 to {GOALS_MAX} goals.")
    for number, goal in enumerate(gesture.goals, start=1):
        _check_goal(number, goal)
    last = gesture.goals[-1].pose
    if last.distance_m(HOME) or abs(last.turn_rad(HOME)) > 1e-9:
        raise BadGesture("A gesture's last goal is home: x 0, y 0, heading 0.")
    total_s = 0.0
    stages = _stages(gesture.goals, DEFAULT_LIMITS)
    for number, (goal, stage) in enumerate(zip(gesture.goals, stages, strict=True), start=1):
        legs, limits, hold_s = stage
        needed_s = SLACK * sum(leg.least_s(limits) for leg in legs) + hold_s
        if goal.within_s < needed_s:
            raise BadGesture(f"Goal {number} needs {needed_s:.1f} s; give it as long.")
        total_s += needed_s
    if total_s > GESTURE_MAX_S:
        raise BadGesture(
            f"This takes up to {total_s:.1f} s; a gesture takes at most {GESTURE_MAX_S:g} s. "
            "Make it smaller or leave goals out."
        )


def _check_goal(number: int, goal: Goal) -> None:
    numbers = (goal.x_m, goal.y_m, goal.heading_rad, goal.within_s, goal.pace, goal.hold_s)
    if not all(map(math.isfinite, numbers)):
        raise BadGesture(f"Goal {number} has a number that is not finite.")
    if math.hypot(goal.x_m, goal.y_m) > REACH_M:
        raise BadGesture(f"Goal {number} is further than {REACH_M:g} m from home.")
    if abs(goal.heading_rad) > TURN_MAX_RAD:
        raise BadGesture(f"Goal {number} turns more than once around.")
    if not 0.2 <= goal.pace <= 1:
        raise BadGesture(f"Goal {number} has a pace outside 0.2 to 1.")
    if not (0 < goal.within_s <= GESTURE_MAX_S and 0 <= goal.hold_s <= goal.within_s):
        raise BadGesture(
            f"Goal {number} takes above 0 and up to {GESTURE_MAX_S:g} s, its hold included."
        )


def _stages(goals: tuple[Goal, ...], limits: Limits) -> list[tuple[tuple[Leg, ...], Limits, float]]:
    """Give each goal's legs, from the goal before, with their limits and the hold [s]."""
    starts = (HOME, *(goal.pose for goal in goals[:-1]))
    return [
        (plan_legs(start, goal.pose), limits.scaled(goal.pace), goal.hold_s)
        for start, goal in zip(starts, goals, strict=True)
    ]


# Up to 4 s each, so that a base is home and still before the next window of 5 s ends. Out and back
# is what a patient sees of a round base; it goes out ahead, never backwards (no rear bumper).
CELEBRATE = Gesture(
    "celebrate",
    "Celebrate: a step ahead and a wiggle",
    (
        Goal(0.07, 0.0, 0.0, within_s=1.6),
        Goal(0.07, 0.0, 0.28, within_s=1.2),
        Goal(0.07, 0.0, -0.28, within_s=1.6),
        Goal(0.0, 0.0, 0.0, within_s=2.5),
    ),
)
DROOP = Gesture(
    "droop",
    "Droop: turn away slowly and come back",
    (
        Goal(0.0, 0.0, -0.45, within_s=2.5, pace=0.5, hold_s=0.5),
        Goal(0.0, 0.0, 0.0, within_s=2.0, pace=0.5),
    ),
)
NOD = Gesture(
    "nod",
    "Nod: a little ahead and back, twice",
    (
        Goal(0.04, 0.0, 0.0, within_s=1.2),
        Goal(0.0, 0.0, 0.0, within_s=1.2),
        Goal(0.04, 0.0, 0.0, within_s=1.2),
        Goal(0.0, 0.0, 0.0, within_s=1.2),
    ),
)
SWAY = Gesture(
    "sway",
    "Sway: left, right and back",
    (
        Goal(0.0, 0.0, 0.4, within_s=1.5),
        Goal(0.0, 0.0, -0.4, within_s=2.0),
        Goal(0.0, 0.0, 0.0, within_s=1.5),
    ),
)

GESTURES: dict[str, Gesture] = {gesture.name: gesture for gesture in (CELEBRATE, DROOP, NOD, SWAY)}

# The original's three sequences (gesture_generation.py of 2024; kobuki.md 1.13, 2.5), for
# replications. It ordered 0.2 m/s and 1.8 rad/s for 1 or 2 s each, without ramps; here are the
# places that these come to, at our limits, so they take longer. Its binary one ended 0.09 m behind
# home; ours goes on home from there.
_OUT_M, _SPIN_RAD = 0.2, 3.6
_LEFT_RAD = _SPIN_RAD / 2
_ASIDE = (_OUT_M * math.cos(_LEFT_RAD), _OUT_M * math.sin(_LEFT_RAD))
ORIGINAL_POSITIVE = Gesture(
    "original_positive",
    "The paper's positive: out, left, right, back",
    (
        Goal(_OUT_M, 0.0, 0.0, within_s=3.4, hold_s=1.0),
        Goal(_OUT_M, 0.0, _SPIN_RAD, within_s=4.5),
        Goal(_OUT_M, 0.0, 0.0, within_s=4.5),
        Goal(0.0, 0.0, 0.0, within_s=2.5),
    ),
)
ORIGINAL_NEGATIVE = Gesture(
    "original_negative",
    "The paper's negative: spin left, spin right",
    (Goal(0.0, 0.0, _SPIN_RAD, within_s=4.5), Goal(0.0, 0.0, 0.0, within_s=4.5)),
)
ORIGINAL_BINARY = Gesture(
    "original_binary",
    "The paper's binary: left and ahead, right and ahead, left, home",
    (
        Goal(0.0, 0.0, _LEFT_RAD, within_s=2.7),
        Goal(*_ASIDE, _LEFT_RAD, within_s=2.5),
        Goal(*_ASIDE, -_LEFT_RAD, within_s=4.5),
        Goal(2 * _ASIDE[0], 0.0, -_LEFT_RAD, within_s=2.5),
        Goal(2 * _ASIDE[0], 0.0, 0.0, within_s=2.7),
        Goal(0.0, 0.0, 0.0, within_s=1.7),
    ),
)

ORIGINALS: dict[str, Gesture] = {
    gesture.name: gesture for gesture in (ORIGINAL_POSITIVE, ORIGINAL_NEGATIVE, ORIGINAL_BINARY)
}
