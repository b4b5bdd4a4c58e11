"""Gestures in a row on a simulated base that is late and drifts, on a clock of their own."""

from __future__ import annotations

import math
from typing import NamedTuple

from robot.base_options import VirtualClock
from robot.bases.kinematic import Imperfections, KinematicBase
from robot.motion.base_response import Response
from robot.motion.gesture import Gesture
from robot.motion.limits import DEFAULT_LIMITS, TICK_S
from robot.motion.player import Player
from robot.motion.pose import HOME
from robot.play_gesture import play_gesture

REST_S = 1.0  # between two gestures; in a session it is longer


class Played(NamedTuple):
    """How a gesture ended, in truth."""

    outcome: str
    took_s: float
    away_m: float
    turned_deg: float


class OrdinaryBase(KinematicBase):
    """A simulation that is not carried home by itself, as real bases are not."""

    def set_home(self) -> None:
        """Make the present place home; it stays where it is."""
        self._odometry.set_home()


def play_in_a_row(
    gesture: Gesture, faults: Imperfections, times: int, response: Response | None = None
) -> list[Played]:
    """Play a gesture several times without setting home anew, until one does not end well.

    ``response`` is what is believed of the base: by default, that nobody has measured it.
    """
    clock = VirtualClock()
    base = OrdinaryBase(clock.monotonic, faults)
    base.response = response or Response()
    results: list[Played] = []
    while len(results) < times:
        for _ in range(round(REST_S / TICK_S)):
            base.stop()
            base.read()
            clock.sleep(TICK_S)
        played = play_gesture(gesture, base, clock.monotonic, clock.sleep)
        truth = base.ground_truth().pose
        results.append(
            Played(
                played["outcome"],
                played["took_s"],
                truth.distance_m(HOME),
                math.degrees(truth.turn_rad(HOME)),
            )
        )
        if played["outcome"] != "done":
            break
    return results


class Seen(NamedTuple):
    """How far a gesture went, in truth, and through which angle it turned."""

    outcome: str
    took_s: float
    away_m: float
    swept_deg: float


def play_seen(gesture: Gesture, faults: Imperfections, pace: float) -> Seen:
    """Play a gesture once, on a base that nobody has measured, and return how far it went."""
    clock = VirtualClock()
    base, player = OrdinaryBase(clock.monotonic, faults), Player(DEFAULT_LIMITS, Response())
    player.start(gesture, clock.now_s, base.read().pose, pace=pace)
    away_m, headings_rad = 0.0, [0.0]
    while player.is_busy:
        base.drive(player.step(clock.now_s, base.read().pose))
        clock.sleep(TICK_S)
        there = base.ground_truth().pose
        away_m = max(away_m, there.distance_m(HOME))
        headings_rad.append(there.heading_rad)
    swept_deg = math.degrees(max(headings_rad) - min(headings_rad))
    return Seen(player.outcome, clock.now_s, away_m, swept_deg)
