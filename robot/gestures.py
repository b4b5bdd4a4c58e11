"""Gestures: places to go to, one after the other, and home again.

A gesture says where, never for how long: timed ones end rotated and displaced as soon as a base
speeds up gently (docs/reference/kobuki.md#timed-gestures). Here are the gestures that we bring
along, and what makes one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from robot.legs import Drive, Leg, lies_on, plan_legs
from robot.motion import DEFAULT_LIMITS, HOME, Limits, Pose

# A base never leaves this circle around its home [m]; gestures keep 5 cm away from its edge
# (docs/reference/kobuki.md#beside-a-person).
TETHER_M = 0.30
REACH_M = 0.25

# How near to its goal a base has to come [m, rad] (docs/reference/kobuki.md#beside-a-person asks
# for 1 cm and 2°).
NEAR_M = 0.004
NEAR_RAD = 0.02

GESTURE_MAX_S = 16.0  # the paper's longest, with slack
GOALS_MAX = 32
TURN_MAX_RAD = math.tau  # a longer cable than this winds up
# Slower turns stick and shake (docs/reference/kobuki.md#what-users-report: below 0.33 rad/s).
LEAST_PACE = 0.2
SLACK = 1.5  # a goal's time over its shortest possible: odometry, grip and latency cost some


def gettext_noop(text: str) -> str:
    """Mark a label: pages say it in their language; the robot's computer knows but one."""
    return text


NOT_FINITE = gettext_noop("{part} {number} has a number that is not finite.")


class Marked(str):
    """A word that has a translation, as it stands in a sentence."""

    __slots__ = ()


class BadGesture(ValueError):
    """A gesture that a base could not perform; the message says what would be one.

    It is ``template`` with ``values`` in its places: whoever shows it says it in another language.
    """

    def __init__(self, template: str, /, **values: object) -> None:
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values


class BadGoal(BadGesture):
    """A gesture of which one goal is at fault: ``number`` says which."""

    def __init__(self, number: int, template: str, /, **values: object) -> None:
        super().__init__(template, part=Marked("Goal"), number=number, **values)
        self.number = number

    def of_step(self, number: int) -> BadGesture:
        """Say it of the step that the goal belongs to."""
        return BadGesture(self.template, **self.values | {"part": Marked("Step"), "number": number})


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
        """Give the gesture at this share of its size, above 0 and up to 1; never longer.

        Ways shrink, and turns with them as long as it drives on the line ahead of home only. Where
        it drives aside its turns say where to, and stay as they are.
        """
        if not 0 < intensity <= 1:
            raise BadGesture("An intensity lies above 0 and up to 1.")
        turns = intensity if self._drives_ahead else 1.0
        goals = tuple(
            replace(
                goal,
                x_m=goal.x_m * intensity,
                y_m=goal.y_m * intensity,
                heading_rad=goal.heading_rad * turns,
            )
            for goal in self.goals
        )
        return replace(self, goals=goals)

    @property
    def _drives_ahead(self) -> bool:
        """Whether it drives with the heading of home only."""
        legs = (leg for legs, _, _ in stages(self.goals, DEFAULT_LIMITS) for leg in legs)
        drives = [leg for leg in legs if isinstance(leg, Drive)]
        return all(abs(drive.heading_rad) < 1e-9 for drive in drives)

    @property
    def least_s(self) -> float:
        """The shortest time that it can take within the default limits [s]."""
        return sum(
            hold_s + sum(leg.least_s(limits) for leg in legs)
            for legs, limits, hold_s in stages(self.goals, DEFAULT_LIMITS)
        )


def check_gesture(gesture: Gesture) -> None:
    """Raise BadGesture, with the cure, for a gesture that is not safe and possible."""
    if not 1 <= len(gesture.goals) <= GOALS_MAX:
        raise BadGesture("A gesture has 1 to {most} goals.", most=GOALS_MAX)
    for number, goal in enumerate(gesture.goals, start=1):
        check_goal(number, goal)
    last = gesture.goals[-1].pose
    if last.distance_m(HOME) or abs(last.turn_rad(HOME)) > 1e-9:
        raise BadGesture("A gesture's last goal is home: x 0, y 0, heading 0.")
    needed_s = [needed_time_s(*stage) for stage in stages(gesture.goals, DEFAULT_LIMITS)]
    if sum(needed_s) > GESTURE_MAX_S:
        raise BadGesture(
            "This takes up to {took:.1f} s; a gesture takes at most {most:g} s. Make it smaller, "
            "or leave something out.",
            took=sum(needed_s),
            most=GESTURE_MAX_S,
        )
    for number, (goal, least_s) in enumerate(zip(gesture.goals, needed_s, strict=True), start=1):
        if goal.within_s < least_s:
            raise BadGoal(
                number,
                "{part} {number} needs {needed:.1f} s; give it as long.",
                needed=math.ceil(10 * least_s) / 10,
            )
    _check_ways_back(gesture.goals)


def needed_time_s(legs: Sequence[Leg], limits: Limits, hold_s: float) -> float:
    """Give the time [s] that a goal has to be given: of its legs, with slack, and of its hold."""
    return SLACK * sum(leg.least_s(limits) for leg in legs) + hold_s


def check_goal(number: int, goal: Goal) -> None:
    """Raise BadGoal for a goal that no gesture may have, whatever comes before it."""
    numbers = (goal.x_m, goal.y_m, goal.heading_rad, goal.within_s, goal.pace, goal.hold_s)
    if not all(map(math.isfinite, numbers)):
        raise BadGoal(number, NOT_FINITE)
    away_m = goal.pose.distance_m(HOME)
    if away_m > REACH_M:
        raise BadGoal(
            number,
            "{part} {number} goes {away:.2f} m away from home, further than {most:g} m. Make it "
            "shorter.",
            away=away_m,
            most=REACH_M,
        )
    if abs(goal.heading_rad) > TURN_MAX_RAD:
        raise BadGoal(
            number, "{part} {number} turns more than once around. Turn back first, or less."
        )
    if not LEAST_PACE <= goal.pace <= 1:
        raise BadGoal(
            number, "{part} {number} has a pace outside {least:g} to 1.", least=LEAST_PACE
        )
    if not (0 < goal.within_s <= GESTURE_MAX_S and 0 <= goal.hold_s <= goal.within_s):
        raise BadGoal(
            number,
            "{part} {number} may take up to {most:g} s, its hold included.",
            most=GESTURE_MAX_S,
        )


def _check_ways_back(goals: Sequence[Goal]) -> None:
    """Refuse a way that is backed over and was not come over before."""
    seen: list[tuple[Pose, Pose]] = []
    start = HOME
    for number, goal in enumerate(goals, start=1):
        for leg in plan_legs(start, goal.pose):
            if not isinstance(leg, Drive):
                continue
            if leg.by_m > 0:
                seen.append((start, goal.pose))
            elif not lies_on(start, goal.pose, seen):
                raise BadGoal(
                    number,
                    "{part} {number} backs where it did not come from; there is no bumper behind. "
                    "Let it face the way, or go ahead first.",
                )
        start = goal.pose


def stages(goals: Sequence[Goal], limits: Limits) -> list[tuple[tuple[Leg, ...], Limits, float]]:
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
    gettext_noop("Celebrate: a step ahead and a wiggle"),
    (
        Goal(0.07, 0.0, 0.0, within_s=1.6),
        Goal(0.07, 0.0, 0.28, within_s=1.2),
        Goal(0.07, 0.0, -0.28, within_s=1.6),
        Goal(0.0, 0.0, 0.0, within_s=2.5),
    ),
)
DROOP = Gesture(
    "droop",
    gettext_noop("Droop: turn away slowly and come back"),
    (
        Goal(0.0, 0.0, -0.45, within_s=2.5, pace=0.5, hold_s=0.5),
        Goal(0.0, 0.0, 0.0, within_s=2.0, pace=0.5),
    ),
)
NOD = Gesture(
    "nod",
    gettext_noop("Nod: a little ahead and back, twice"),
    (
        Goal(0.04, 0.0, 0.0, within_s=1.2),
        Goal(0.0, 0.0, 0.0, within_s=1.2),
        Goal(0.04, 0.0, 0.0, within_s=1.2),
        Goal(0.0, 0.0, 0.0, within_s=1.2),
    ),
)
SWAY = Gesture(
    "sway",
    gettext_noop("Sway: left, right and back"),
    (
        Goal(0.0, 0.0, 0.4, within_s=1.5),
        Goal(0.0, 0.0, -0.4, within_s=2.0),
        Goal(0.0, 0.0, 0.0, within_s=1.5),
    ),
)

GESTURES: dict[str, Gesture] = {gesture.name: gesture for gesture in (CELEBRATE, DROOP, NOD, SWAY)}

# The original's three sequences (gesture_generation.py of 2024; docs/reference/original.md#robot),
# for replications. It ordered 0.2 m/s and 1.8 rad/s for 1 or 2 s each, without ramps; here are the
# places that these come to, at our limits, so they take longer. Its binary one ended 0.09 m behind
# home; ours goes on home from there.
_OUT_M, _SPIN_RAD = 0.2, 3.6
_LEFT_RAD = _SPIN_RAD / 2
_ASIDE = (_OUT_M * math.cos(_LEFT_RAD), _OUT_M * math.sin(_LEFT_RAD))
ORIGINAL_POSITIVE = Gesture(
    "original_positive",
    gettext_noop("The paper's positive: out, left, right, back"),
    (
        Goal(_OUT_M, 0.0, 0.0, within_s=3.4, hold_s=1.0),
        Goal(_OUT_M, 0.0, _SPIN_RAD, within_s=4.5),
        Goal(_OUT_M, 0.0, 0.0, within_s=4.5),
        Goal(0.0, 0.0, 0.0, within_s=2.5),
    ),
)
ORIGINAL_NEGATIVE = Gesture(
    "original_negative",
    gettext_noop("The paper's negative: spin left, spin right"),
    (Goal(0.0, 0.0, _SPIN_RAD, within_s=4.5), Goal(0.0, 0.0, 0.0, within_s=4.5)),
)
ORIGINAL_BINARY = Gesture(
    "original_binary",
    gettext_noop("The paper's binary: left and ahead, right and ahead, left, home"),
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
