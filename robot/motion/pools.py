"""Pools of gestures: many variants of each answer, composed from a small table.

The table's columns follow Laban's Effort for a mobile base (Knight and Simmons, 2014): a path, its
size, its speed, how suddenly it goes and how directly. Each variant of a path that turns exists to
both sides.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from robot.marking import gettext_noop
from robot.motion.gesture import GESTURE_MAX_S, Gesture, Waypoint, needed_time_s, stages
from robot.motion.limits import DEFAULT_LIMITS
from robot.motion.score import (
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

# Shares of a row's size to drive ahead and to turn; then home. Direct paths go there at once,
# indirect ones in parts. (Swings past home and back end in a short turn, where a late base errs.)
PATHS: dict[str, tuple[tuple[float, float], ...]] = {
    "dash": ((1, 0),),
    "climb": ((0.45, 0), (1, 0)),
    "ebb": ((1, 0), (0.45, 0)),
    "look": ((0, 1),),
    "peek": ((0, 0.5), (0, 1)),
    "linger": ((0, 1), (0, 0.5)),
}


class Effort(NamedTuple):
    """A row of the table: how one path is performed.

    Parameters
    ----------
    path
        A key of ``PATHS``.
    size
        How far it drives [m], or turns [°] where the path only turns.
    out, back
        Speed on the way out and on the way home, as shares of the limits. Out faster than back is
        sudden, the other way round is sustained.
    hold_s
        How long it stays at the end of the way out [s].
    score
        What it shows and plays.
    """

    path: str
    size: float
    out: float
    back: float
    hold_s: float
    score: Score

    @property
    def turns(self) -> bool:
        """Whether it turns on the spot, and so exists to both sides."""
        return all(ahead == 0 for ahead, _turn in PATHS[self.path])


class Pool(NamedTuple):
    """What a pool is called, and the rows of its variants."""

    label: str
    rows: tuple[Effort, ...]


# The names of the variants follow from the order and stand in logs: append rows, never reorder.
TABLE: dict[str, Pool] = {
    "joy": Pool(
        gettext_noop("Joy"),
        (
            Effort("dash", 0.15, 1.0, 1.0, 0.0, RISING),
            Effort("look", 70, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("climb", 0.14, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("peek", 60, 1.0, 1.0, 0.0, RISING),
            Effort("look", 64, 1.0, 0.75, 0.0, RISING_HIGH),
            Effort("ebb", 0.14, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("dash", 0.12, 1.0, 1.0, 0.4, RISING_LONG),
            Effort("look", 60, 1.0, 1.0, 0.3, RISING_LONG),
            Effort("linger", 60, 1.0, 1.0, 0.0, RISING),
        ),
    ),
    "streak_3": Pool(
        gettext_noop("Three in a row"),
        (
            Effort("dash", 0.17, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("look", 75, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("climb", 0.15, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("ebb", 0.15, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("peek", 66, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("linger", 66, 1.0, 1.0, 0.0, RISING_HIGH),
        ),
    ),
    "streak_5": Pool(
        gettext_noop("Five in a row"),
        (
            Effort("dash", 0.18, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("look", 82, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("peek", 68, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("climb", 0.16, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("ebb", 0.16, 1.0, 1.0, 0.0, RISING_HIGH),
            Effort("linger", 68, 1.0, 1.0, 0.0, RISING_HIGH),
        ),
    ),
    "streak_10": Pool(
        gettext_noop("Ten in a row"),
        (
            Effort("dash", 0.20, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("look", 90, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("peek", 70, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("climb", 0.17, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("ebb", 0.17, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("linger", 72, 1.0, 1.0, 0.0, RISING_LONG),
        ),
    ),
    "comeback": Pool(
        gettext_noop("Comeback"),
        (
            Effort("dash", 0.14, 0.75, 1.0, 0.2, RISING_LONG),
            Effort("look", 62, 0.75, 1.0, 0.0, RISING),
            Effort("climb", 0.13, 0.85, 1.0, 0.0, RISING),
            Effort("linger", 58, 1.0, 1.0, 0.0, RISING_LONG),
            Effort("peek", 58, 0.85, 1.0, 0.0, RISING),
            Effort("ebb", 0.13, 0.85, 1.0, 0.0, RISING_LONG),
        ),
    ),
    "disappointment": Pool(
        gettext_noop("Disappointment"),
        (
            Effort("look", 58, 0.75, 0.75, 0.0, FALLING),
            Effort("dash", 0.12, 0.75, 0.75, 0.0, LOW_FALLING),
            Effort("linger", 52, 0.8, 0.75, 0.0, SIGHING),
            Effort("peek", 52, 0.75, 0.8, 0.0, LOW_FALLING),
            Effort("look", 50, 0.85, 0.75, 0.4, SIGHING),
            Effort("ebb", 0.115, 0.8, 0.75, 0.0, FALLING),
            Effort("dash", 0.11, 0.8, 0.75, 0.4, SIGHING),
            Effort("look", 56, 0.9, 0.65, 0.0, LOW_FALLING),
        ),
    ),
    "near_miss": Pool(
        gettext_noop("Near miss"),
        (
            Effort("look", 60, 1.0, 0.75, 0.0, ASKING),
            Effort("dash", 0.12, 1.0, 0.75, 0.2, ASKING),
            Effort("climb", 0.12, 1.0, 0.85, 0.0, ASKING),
            Effort("ebb", 0.12, 1.0, 0.8, 0.0, ASKING),
            Effort("peek", 52, 1.0, 0.8, 0.0, ASKING),
            Effort("linger", 54, 1.0, 0.85, 0.0, ASKING),
        ),
    ),
    "effort": Pool(
        gettext_noop("Effort"),
        (
            Effort("dash", 0.13, 0.75, 0.9, 0.0, ASKING),
            Effort("climb", 0.12, 0.85, 0.9, 0.0, ASKING),
            Effort("look", 58, 0.75, 0.9, 0.0, ASKING),
            Effort("peek", 54, 0.8, 1.0, 0.0, ASKING),
            Effort("ebb", 0.12, 0.85, 0.9, 0.0, ASKING),
            Effort("linger", 54, 0.85, 0.9, 0.0, ASKING),
        ),
    ),
    "greeting": Pool(
        gettext_noop("Greeting"),
        (
            Effort("dash", 0.14, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("peek", 54, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("look", 60, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("dash", 0.12, 0.9, 0.9, 0.4, NEUTRAL),
            Effort("linger", 56, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("climb", 0.12, 0.9, 0.9, 0.0, NEUTRAL),
        ),
    ),
    "rest": Pool(
        gettext_noop("Rest"),
        (
            Effort("look", 50, 0.75, 0.75, 0.2, NEUTRAL),
            Effort("dash", 0.11, 0.75, 0.75, 0.2, NEUTRAL),
            Effort("linger", 50, 0.8, 0.8, 0.0, NEUTRAL),
            Effort("peek", 50, 0.8, 0.8, 0.0, NEUTRAL),
            Effort("ebb", 0.11, 0.8, 0.75, 0.0, NEUTRAL),
        ),
    ),
    "farewell": Pool(
        gettext_noop("Farewell"),
        (
            Effort("linger", 54, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("ebb", 0.13, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("dash", 0.12, 1.0, 0.75, 0.3, NEUTRAL),
            Effort("look", 64, 0.9, 0.8, 0.0, NEUTRAL),
            Effort("climb", 0.12, 0.9, 0.9, 0.0, NEUTRAL),
            Effort("peek", 54, 0.9, 0.9, 0.0, NEUTRAL),
        ),
    ),
}

# No variant is performed below 10 cm or 45°, however weak the answer and however quiet the room: a
# walker 2 m away sees that without looking for it. (Ours.)
LEAST_M, LEAST_RAD = 0.105, math.radians(46.5)  # a player stops a little before each place
# Beside the time that it needs, for each waypoint; at home a late base may turn once more.
ROOM_S, HOME_ROOM_S = 0.5, 1.2


def _compose(name: str, label: str, row: Effort, side: int) -> Gesture:
    """Return the variant of a row that turns to the left (1) or to the right (-1)."""
    path = PATHS[row.path]
    size_m, turn_rad = (0.0, math.radians(row.size)) if row.turns else (row.size, 0.0)
    end = max(range(len(path)), key=lambda at: max(path[at]))  # of the way out
    places = [
        Waypoint(
            size_m * ahead,
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
    least = LEAST_RAD / turn_rad if row.turns else LEAST_M / size_m
    return Gesture(name, label, waypoints, row.score, least=min(least, 1.0))


def _spread(pool: str, label: str, rows: Sequence[Effort]) -> Iterator[Gesture]:
    """Yield the variants of a pool: one of each row, or two where it turns on the spot."""
    sides = [(row, side) for row in rows for side in ((1, -1) if row.turns else (1,))]
    for number, one in enumerate(sides, start=1):
        yield _compose(f"{pool}_{number}", f"{label} {number}", *one)


# Idle life between answers: smaller and slower than any answer, lights alone. No cue names it.
IDLE_SCORE = Score((Light(0.0, Color.ORANGE, Color.OFF),))
IDLE_ROWS = (
    Effort("dash", 0.04, 0.5, 0.5, 0.0, IDLE_SCORE),  # a breath
    Effort("look", 16, 0.5, 0.5, 0.0, IDLE_SCORE),  # a small gaze
    Effort("dash", 0.05, 0.4, 0.4, 0.3, IDLE_SCORE),
    Effort("look", 12, 0.5, 0.4, 0.5, IDLE_SCORE),
    Effort("look", 20, 0.5, 0.5, 0.0, IDLE_SCORE),
)
IDLE = tuple(_spread("idle", gettext_noop("Idle"), IDLE_ROWS))  # in full size: never scaled
POOLS: dict[str, tuple[Gesture, ...]] = {
    pool: tuple(_spread(pool, label, rows)) for pool, (label, rows) in TABLE.items()
}
VARIANTS: dict[str, Gesture] = {one.name: one for pool in POOLS.values() for one in pool}
