"""Specifications of composed gestures: steps relative to the base, converted to poses from home.

They are sent as data, so that a new gesture needs no new robot software. Server and robot both
parse them here, and so refuse the same ones with the same message.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from robot.marking import Marked
from robot.motion.gesture import (
    GESTURE_MAX_S,
    VISIBLE_M,
    VISIBLE_RAD,
    Gesture,
    Waypoint,
    check_waypoint,
    needed_time_s,
    stages,
)
from robot.motion.gesture_errors import NOT_FINITE, BadGesture, BadWaypoint
from robot.motion.gestures import known_names
from robot.motion.lights_and_sounds import read_score
from robot.motion.limits import DEFAULT_LIMITS
from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import Twist

NAME = re.compile(r"[A-Za-z0-9_-]{1,32}")
MAX_MOVES = 16
MIN_FORWARD_M = 0.01  # a shorter way is invisible, and within the base's tolerance
MIN_TURN_RAD = math.radians(1)

# The last step ends at home if it is so near [m, rad]: people round 0.1414 m to 0.14.
HOME_M = 0.005
HOME_RAD = math.radians(2)

# A step without a time of its own gets this multiple of the time that it needs, about twice the
# shortest possible (docs/reference/kobuki.md#beside-a-person), and some extra [s] for the last
# millimeters of a very short one.
TIME_FACTOR, EXTRA_S = 1.4, 0.5


@dataclass(frozen=True, slots=True)
class Move:
    """One step of a composed gesture: a turn on the spot, then a way straight on, then a pause.

    Parameters
    ----------
    turn_rad
        Counter-clockwise, so to the left where positive [rad].
    forward_m
        Backwards where negative [m].
    hold_s
        How long to stay there [s].
    pace
        Share of the limits to go at, ``MIN_PACE`` to 1.
    within_s
        Time that it may take, pause included [s]; None for as long as it needs.
    """

    turn_rad: float = 0.0
    forward_m: float = 0.0
    hold_s: float = 0.0
    pace: float = 1.0
    within_s: float | None = None


NUMBERS = [field.name for field in fields(Move)]


def to_data(name: str, moves: Sequence[Move]) -> dict[str, Any]:
    """Return the JSON data of a gesture.

    Parameters
    ----------
    name
        Its name; not checked here.
    moves
        Its steps.
    """
    return {"name": name, "steps": [asdict(move) for move in moves]}


def parse_gesture(data: Any) -> Gesture:
    """Return the gesture that JSON data specify.

    Parameters
    ----------
    data
        ``{"name": …, "steps": [{"turn_rad": …, "forward_m": …, …}]}``, as ``to_data`` writes it;
        and tracks of lights and notes where it has any (``read_score``).

    Raises
    ------
    BadGesture
        For anything else, and for what ``build_gesture`` refuses; names the step and the cure.
    """
    if not isinstance(data, Mapping):
        raise BadGesture("A gesture is an object with a name and steps.")
    steps = data.get("steps")
    if not isinstance(steps, list):
        raise BadGesture("A gesture has a list of steps.")
    moves = [_read_move(n, step) for n, step in enumerate(steps, start=1)]
    return replace(build_gesture(data.get("name"), moves), score=read_score(data))


def _read_move(number: int, step: Any) -> Move:
    if not isinstance(step, Mapping):
        raise BadGesture("Step {number} is no object.", number=number)
    given = {name: step[name] for name in NUMBERS if step.get(name) is not None}
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadGesture('Step {number}: "{name}" is a number.', number=number, name=name)
    try:
        return Move(**{name: float(value) for name, value in given.items()})
    except OverflowError:
        raise BadGesture(NOT_FINITE, part=Marked("Step"), number=number) from None


def check_name(name: Any) -> str:
    """Return a name. Raises BadGesture for an invalid one, and for that of a built-in gesture."""
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise BadGesture("A gesture's name has 1 to 32 letters, digits, hyphens or underscores.")
    if name in known_names():
        raise BadGesture("Every robot knows {name} already. Choose another name.", name=name)
    return name


def build_gesture(name: Any, moves: Sequence[Move]) -> Gesture:
    """Return the gesture that steps describe.

    Parameters
    ----------
    name
        1 to 32 letters, digits, hyphens or underscores; not that of a built-in gesture.
    moves
        1 to ``MAX_MOVES`` steps, which end at home within ``HOME_M`` and ``HOME_RAD``.

    Raises
    ------
    BadGesture
        For a step or a gesture that no base may perform; names the step and the cure.
    """
    check_name(name)
    if not 1 <= len(moves) <= MAX_MOVES:
        raise BadGesture("A gesture has 1 to {most} steps.", most=MAX_MOVES)
    for number, move in enumerate(moves, start=1):
        _check_move(number, move)
    step_waypoints = list(_to_waypoints(moves))
    waypoints = [waypoint for step in step_waypoints for waypoint in step]
    owners = [number for number, step in enumerate(step_waypoints, start=1) for _ in step]
    try:
        for number, waypoint in enumerate(waypoints, start=1):
            check_waypoint(number, waypoint)
        waypoints[-1] = _end_at_home(waypoints[-1])
        gesture = Gesture(name, name, tuple(_assign_times(waypoints, owners, moves)))
    except BadWaypoint as problem:
        raise problem.for_step(owners[problem.number - 1]) from None
    if not gesture.is_visible:
        raise BadGesture(
            "Nobody would see it. Let it go {way:.0f} cm or turn by {turn:.0f}° at least.",
            way=100 * VISIBLE_M,
            turn=math.degrees(VISIBLE_RAD),
        )
    return gesture


def _check_move(number: int, move: Move) -> None:
    numbers = (move.turn_rad, move.forward_m, move.hold_s, move.pace, move.within_s or 0.0)
    if not all(map(math.isfinite, numbers)):
        raise BadGesture(NOT_FINITE, part=Marked("Step"), number=number)
    if not (move.turn_rad or move.forward_m or move.hold_s):
        raise BadGesture(
            "Step {number} does nothing. Give it a turn, a way or a pause.", number=number
        )
    if 0 < abs(move.forward_m) < MIN_FORWARD_M:
        raise BadGesture(
            "Step {number} goes less than {least:g} m, which nobody sees. Make it longer.",
            number=number,
            least=MIN_FORWARD_M,
        )
    if 0 < abs(move.turn_rad) < MIN_TURN_RAD:
        raise BadGesture(
            "Step {number} turns by less than 1°, which nobody sees. Turn further.", number=number
        )


def _to_waypoints(moves: Sequence[Move]) -> Iterator[list[Waypoint]]:
    """Yield the waypoints of each step: its turn, then its drive. Times are set later."""
    here = HOME
    for move in moves:
        turned = replace(here, heading_rad=here.heading_rad + move.turn_rad)
        poses = [turned] if move.turn_rad or not move.forward_m else []
        if move.forward_m:
            poses.append(_ahead(turned, move.forward_m))
        step = [Waypoint(p.x_m, p.y_m, p.heading_rad, GESTURE_MAX_S, move.pace) for p in poses]
        step[-1] = replace(step[-1], hold_s=move.hold_s)
        yield step
        here = step[-1].pose


def _ahead(pose: Pose, by_m: float) -> Pose:
    """Return the pose ahead; a place that is almost home becomes home."""
    place = advance(pose, Twist(by_m), 1.0)
    return Pose(heading_rad=pose.heading_rad) if place.distance_m(HOME) <= HOME_M else place


def _end_at_home(last: Waypoint) -> Waypoint:
    """Return the last waypoint moved to home. Raises BadGesture where it is not near."""
    heading_rad = math.tau * round(last.heading_rad / math.tau)
    away_m, off_rad = last.pose.distance_m(HOME), last.heading_rad - heading_rad
    far, turned = 100 * away_m, abs(math.degrees(off_rad))
    side = Marked("left") if off_rad > 0 else Marked("right")
    if abs(off_rad) > HOME_RAD and away_m:
        raise BadGesture(
            "It ends {far:.0f} cm from home, turned by {turned:.0f}° to the {side}. Add steps that "
            "lead back home.",
            far=far,
            turned=turned,
            side=side,
        )
    if abs(off_rad) > HOME_RAD:
        raise BadGesture(
            "It ends turned by {turned:.0f}° to the {side}. Add steps that lead back home.",
            turned=turned,
            side=side,
        )
    if away_m:
        raise BadGesture("It ends {far:.0f} cm from home. Add steps that lead back home.", far=far)
    return replace(last, x_m=0.0, y_m=0.0, heading_rad=heading_rad)


def _assign_times(
    waypoints: Sequence[Waypoint], owners: Sequence[int], moves: Sequence[Move]
) -> Iterator[Waypoint]:
    """Share each step's time among its waypoints, by what they need."""
    needed_s = [needed_time_s(*stage) for stage in stages(waypoints, DEFAULT_LIMITS)]
    of_step = dict.fromkeys(owners, 0.0)
    for owner, min_duration_s in zip(owners, needed_s, strict=True):
        of_step[owner] += min_duration_s
    for waypoint, owner, min_duration_s in zip(waypoints, owners, needed_s, strict=True):
        all_s, given_s = of_step[owner], moves[owner - 1].within_s
        if given_s is None:
            given_s = min(TIME_FACTOR * all_s + EXTRA_S, max(GESTURE_MAX_S, all_s))
        elif given_s < all_s:
            raise BadGesture(
                "Step {number} needs {needed:.1f} s. Give it as long, or leave its time empty.",
                number=owner,
                needed=math.ceil(10 * all_s) / 10,
            )
        yield replace(waypoint, within_s=min(given_s * min_duration_s / all_s, GESTURE_MAX_S))
