"""Pools of gestures: many variants of each answer, composed from a small table.

The table's columns follow Laban's Effort for a mobile base (Knight and Simmons, 2014): a path, its
size, its speed, how suddenly it goes and how directly. Each variant of a path that turns exists to
both sides.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

from robot.marking import gettext_noop
from robot.motion.gesture import GESTURE_MAX_S, Gesture, Waypoint, needed_time_s, stages
from robot.motion.lights_and_sounds import (
    ASKING,
    FALLING,
    LOW_FALLING,
    NEUTRAL,
    RISING,
    RISING_HIGH,
    RISING_LONG,
    SIGHING,
    Color,
    Light,
    Score,
)
from robot.motion.limits import DEFAULT_LIMITS

# Shares of a row's way ahead and of its turn; then home. By this a base without a face is read:
# joy turns to both sides, fast; disappointment to one, slowly; a greeting comes near.
PATHS: dict[str, tuple[tuple[float, float], ...]] = {
    "dash": ((1, 0),),
    "climb": ((0.45, 0), (1, 0)),
    "ebb": ((1, 0), (0.45, 0)),
    "look": ((0, 1),),
    "peek": ((0, 0.5), (0, 1)),
    "linger": ((0, 1), (0, 0.5)),
    "wag": ((0, 1), (0, -1)),
    "swing": ((0, 0.6), (0, -1)),
    "fling": ((0, 1), (0, -0.5)),
    "waggle": ((0, 1), (0, -1), (0, 1)),
    "swell": ((0, 0.5), (0, -0.75), (0, 1)),
    "hello": ((1, 0), (1, 1), (1, -1)),
}


class Effort(NamedTuple):
    """A row of the table: how one path is performed.

    Parameters
    ----------
    path
        A key of ``PATHS``.
    ahead_m, turn_deg
        How far it drives [m] and turns [°].
    out, back
        Speed on the way out and on the way home, as shares of the limits. Out faster than back is
        sudden, the other way round is sustained.
    hold_s
        How long it stays at the end of the way out [s].
    score
        What it shows and plays.
    """

    path: str
    ahead_m: float
    turn_deg: float
    out: float
    back: float
    hold_s: float
    score: Score

    @property
    def sides(self) -> tuple[int, ...]:
        """To which sides it exists: the left (1) and the right (-1) where it turns."""
        return (1, -1) if self.turn_deg else (1,)


class Pool(NamedTuple):
    """What a pool is called, and the rows of its variants."""

    label: str
    rows: tuple[Effort, ...]


# The names of the variants follow from the order and stand in logs: append rows, never reorder.
TABLE: dict[str, Pool] = {
    "joy": Pool(
        gettext_noop("Joy"),
        (
            Effort("waggle", 0, 23.5, 1.0, 1.0, 0.0, RISING),
            Effort("wag", 0, 32, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("swell", 0, 29, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("swing", 0, 35, 1.0, 1.0, 0.0, RISING),
            Effort("fling", 0, 38, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("wag", 0, 28, 1.0, 1.0, 0.3, RISING_LONG),
        ),
    ),
    "streak_3": Pool(
        gettext_noop("Three in a row"),
        (
            Effort("wag", 0, 35, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("swell", 0, 30, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("swing", 0, 38, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("fling", 0, 42, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("waggle", 0, 23.5, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("wag", 0, 32, 1.0, 1.0, 0.3, RISING_HIGH),
        ),
    ),
    "streak_5": Pool(
        gettext_noop("Five in a row"),
        (
            Effort("wag", 0, 38, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("waggle", 0, 23.5, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("swing", 0, 42, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("fling", 0, 46, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("swell", 0, 31, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("wag", 0, 35, 1.0, 1.0, 0.3, RISING_LONG),
        ),
    ),
    "streak_10": Pool(
        gettext_noop("Ten in a row"),
        (
            Effort("wag", 0, 41, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("swing", 0, 46, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("swell", 0, 32, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("fling", 0, 50, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("waggle", 0, 24, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("wag", 0, 38, 1.0, 1.0, 0.3, RISING_LONG),
        ),
    ),
    "comeback": Pool(
        gettext_noop("Comeback"),
        (
            Effort("swing", 0, 34, 0.9, 1.0, 0.0, RISING_LONG),
            Effort("wag", 0, 28, 0.9, 1.0, 0.0, RISING),
            Effort("swell", 0, 28, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("fling", 0, 36, 0.9, 1.0, 0.0, RISING_LONG),
            Effort("wag", 0, 26, 1.0, 1.0, 0.3, RISING),
        ),
    ),
    "disappointment": Pool(
        gettext_noop("Disappointment"),
        (
            Effort("look", 0, 62, 0.45, 0.7, 0.3, FALLING),
            Effort("look", 0, 66, 0.5, 0.7, 0.3, LOW_FALLING),
            Effort("linger", 0, 60, 0.55, 0.6, 0.0, SIGHING),
            Effort("peek", 0, 60, 0.55, 0.6, 0.0, LOW_FALLING),
            Effort("look", 0, 58, 0.5, 0.6, 0.4, SIGHING),
        ),
    ),
    "near_miss": Pool(
        gettext_noop("Near miss"),
        (
            Effort("look", 0, 60, 1.0, 0.75, 0.0, ASKING),
            Effort("dash", 0.12, 0, 1.0, 0.75, 0.2, ASKING),
            Effort("climb", 0.12, 0, 1.0, 0.85, 0.0, ASKING),
            Effort("ebb", 0.12, 0, 1.0, 0.8, 0.0, ASKING),
            Effort("peek", 0, 52, 1.0, 0.8, 0.0, ASKING),
            Effort("linger", 0, 54, 1.0, 0.85, 0.0, ASKING),
        ),
    ),
    "effort": Pool(
        gettext_noop("Effort"),
        (
            Effort("dash", 0.13, 0, 0.75, 0.9, 0.0, ASKING),
            Effort("climb", 0.12, 0, 0.85, 0.9, 0.0, ASKING),
            Effort("look", 0, 58, 0.75, 0.9, 0.0, ASKING),
            Effort("peek", 0, 54, 0.8, 1.0, 0.0, ASKING),
            Effort("ebb", 0.12, 0, 0.85, 0.9, 0.0, ASKING),
            Effort("linger", 0, 54, 0.85, 0.9, 0.0, ASKING),
        ),
    ),
    "greeting": Pool(
        gettext_noop("Greeting"),
        (
            Effort("dash", 0.15, 0, 0.7, 0.7, 0.5, NEUTRAL),
            Effort("climb", 0.14, 0, 0.8, 0.7, 0.3, NEUTRAL),
            Effort("dash", 0.13, 0, 0.6, 0.6, 0.6, NEUTRAL),
            Effort("ebb", 0.14, 0, 0.7, 0.8, 0.3, NEUTRAL),
            Effort("dash", 0.16, 0, 0.8, 0.6, 0.2, NEUTRAL),
            Effort("climb", 0.12, 0, 0.7, 0.8, 0.4, NEUTRAL),
            Effort("ebb", 0.12, 0, 0.8, 0.7, 0.4, NEUTRAL),
            Effort("dash", 0.14, 0, 0.6, 0.8, 0.4, NEUTRAL),
            Effort("hello", 0.11, 12, 1.0, 1.0, 0.0, NEUTRAL),
        ),
    ),
    "rest": Pool(
        gettext_noop("Rest"),
        (
            Effort("dash", 0.11, 0, 0.5, 0.5, 0.2, NEUTRAL),
            Effort("climb", 0.11, 0, 0.5, 0.5, 0.0, NEUTRAL),
            Effort("ebb", 0.11, 0, 0.5, 0.5, 0.0, NEUTRAL),
            Effort("dash", 0.12, 0, 0.5, 0.6, 0.0, NEUTRAL),
            Effort("climb", 0.115, 0, 0.6, 0.5, 0.0, NEUTRAL),
            Effort("ebb", 0.115, 0, 0.6, 0.5, 0.0, NEUTRAL),
            Effort("dash", 0.11, 0, 0.6, 0.5, 0.3, NEUTRAL),
            Effort("climb", 0.11, 0, 0.55, 0.6, 0.2, NEUTRAL),
        ),
    ),
    "farewell": Pool(
        gettext_noop("Farewell"),
        (
            Effort("linger", 0, 54, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("ebb", 0.13, 0, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("dash", 0.12, 0, 1.0, 0.75, 0.3, NEUTRAL),
            Effort("look", 0, 64, 0.9, 0.8, 0.0, NEUTRAL),
            Effort("climb", 0.12, 0, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("peek", 0, 54, 0.9, 0.9, 0.0, NEUTRAL),
        ),
    ),
}

# No variant is performed below 10 cm or 45°, however weak the answer and however quiet the room: a
# walker 2 m away sees that without looking for it. (Ours.)
LEAST_M, LEAST_RAD = 0.105, math.radians(47)  # a player stops a little before each place
# Of what does not fit into 4.5 s on a late base at a gentle pace, gentle answers have none [s].
MOST_S = 4.2
# Beside the time that it needs, for each waypoint; at home a late base may turn once more.
ROOM_S, HOME_ROOM_S = 0.5, 1.2


def _compose(name: str, label: str, row: Effort, side: int) -> Gesture:
    """Return the variant of a row that turns to the left (1) or to the right (-1)."""
    path, turn_rad = PATHS[row.path], math.radians(row.turn_deg)
    end = max(range(len(path)), key=lambda at: (path[at][0] + abs(path[at][1]), at))  # way out's
    places = [
        Waypoint(
            row.ahead_m * ahead,
            0.0,
            side * turn_rad * turn,
            within_s=GESTURE_MAX_S,
            pace=row.out if at <= end else row.back,
            hold_s=row.hold_s if at == end else 0.0,
        )
        for at, (ahead, turn) in enumerate((*path, (0, 0)))
    ]
    waypoints = tuple(
        replace(place, within_s=round(needed_time_s(*stage) + room_s, 2))
        for place, stage, room_s in zip(
            places,
            stages(places, DEFAULT_LIMITS),
            (*[ROOM_S] * len(path), HOME_ROOM_S),
            strict=True,
        )
    )
    turns = [0.0, *(turn for _ahead, turn in path)]
    swept_rad = turn_rad * (max(turns) - min(turns))
    least = LEAST_M / row.ahead_m if row.ahead_m else LEAST_RAD / swept_rad
    return Gesture(name, label, waypoints, row.score, least=min(least, 1.0))


def _spread(pool: str, label: str, rows: Sequence[Effort]) -> Iterator[Gesture]:
    """Yield the variants of a pool: one of each row and side."""
    sides = [(row, side) for row in rows for side in row.sides]
    for number, one in enumerate(sides, start=1):
        yield _compose(f"{pool}_{number}", f"{label} {number}", *one)


# Idle life between answers: smaller and slower than any answer, lights alone. No cue names it.
IDLE_SCORE = Score((Light(0.0, Color.ORANGE, Color.OFF),))
IDLE_ROWS = (
    Effort("dash", 0.025, 0, 0.5, 0.5, 0.0, IDLE_SCORE),  # a breath
    Effort("look", 0, 8, 0.5, 0.5, 0.0, IDLE_SCORE),  # a small gaze
    Effort("dash", 0.03, 0, 0.4, 0.4, 0.3, IDLE_SCORE),
    Effort("look", 0, 7, 0.5, 0.4, 0.5, IDLE_SCORE),
    Effort("look", 0, 10, 0.5, 0.5, 0.0, IDLE_SCORE),
)
IDLE = tuple(_spread("idle", gettext_noop("Idle"), IDLE_ROWS))  # in full size: never scaled
POOLS: dict[str, tuple[Gesture, ...]] = {
    pool: tuple(_spread(pool, label, rows)) for pool, (label, rows) in TABLE.items()
}
VARIANTS: dict[str, Gesture] = {one.name: one for pool in POOLS.values() for one in pool}


@cache
def variants(pool: str, pace: float) -> tuple[Gesture, ...]:
    """Return a pool's variants that are short enough at a share of the limits."""
    return tuple(one for one in POOLS[pool] if one.scaled(one.least).min_duration_s(pace) <= MOST_S)
