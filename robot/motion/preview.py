"""Previews of gestures: motion, lights and notes on one clock, as data that a page plays."""

from __future__ import annotations

import math
from typing import Any

from robot.motion.dry_run import dry_run
from robot.motion.face_and_arms import EACH_S, look_of
from robot.motion.gesture import Gesture
from robot.motion.limits import TICK_S

ANNOUNCED_S = 0.5  # a base with lights and sounds shows these before it moves (docs/safety.md)
EVERY = 2  # of the poses of a dry run: 25 a second


def preview(gesture: Gesture, pace: float = 1.0, *, is_quiet: bool = False) -> dict[str, Any]:
    """Return what a base would do and when, seconds from the announcement on.

    Parameters
    ----------
    gesture
        What to play.
    pace
        Share of the limits to go at, at most, above 0 and up to 1.
    is_quiet
        Whether it is played for a quiet room.

    Returns
    -------
    dict
        ``took_s``; ``mood``; ``looks`` of ``at_s, mouth, eyes`` (``Look``); ``poses`` of ``at_s,
        x_m, y_m, heading_rad``; ``lights`` of ``at_s, first, second``; ``notes`` of ``at_s,
        frequency_hz, duration_s, melody``.
    """
    played = dry_run(gesture, pace=pace)
    score = gesture.score.quiet if is_quiet else gesture.score
    poses = [(ANNOUNCED_S + tick * TICK_S, pose) for tick, pose in enumerate(played.poses)]
    took_s = ANNOUNCED_S + played.took_s
    begun_s = [EACH_S * number for number in range(math.ceil(took_s / EACH_S))]
    looks = [(at_s, look_of(gesture.name, gesture.score.mood, at_s)) for at_s in begun_s]
    return {
        "mood": score.mood,
        "looks": [[round(at_s, 3), look.mouth, look.eyes] for at_s, look in looks],
        "took_s": round(took_s, 3),
        "poses": [
            [round(at_s, 3), round(pose.x_m, 4), round(pose.y_m, 4), round(pose.heading_rad, 4)]
            for at_s, pose in [*poses[::EVERY], poses[-1]]
        ],
        "lights": [[one.at_s, one.first.value, one.second.value] for one in score.lights],
        "notes": [
            [one.at_s, one.frequency_hz, one.duration_s, one.melody and one.melody.value]
            for one in score.notes
        ],
    }
