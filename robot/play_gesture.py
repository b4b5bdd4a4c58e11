"""`python -m robot gesture NAME --base BASE`: plays a gesture without a server.

For trying a base and its place. Running it arms a real base: stand at its switch.
Exit status: 0 it was played; 1 it ended otherwise, or the base does not answer; 2 the command line
cannot be used; 130 Ctrl-C.
"""

from __future__ import annotations

import json
import sys
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from robot.base_options import add_base_arguments, make_base
from robot.bases import BASES, BadOption, BaseLost, MobileBase
from robot.behavior.control_loop import control_loop
from robot.behavior.performer import Performer
from robot.motion.gesture import Gesture
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import TICK_S
from robot.motion.player import DONE
from robot.motion.pose import HOME

REST_S = 0.3  # until wheels, odometry and true pose have come to rest


class VirtualClock:
    """A clock that only ``sleep`` advances."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        """Return the time [s]."""
        return self.now_s

    def sleep(self, span_s: float) -> None:
        """Advance the clock by a span [s]."""
        self.now_s += span_s


def play_gesture(
    gesture: Gesture,
    base: MobileBase,
    monotonic: Callable[[], float],
    sleep: Callable[[float], object],
) -> dict[str, Any]:
    """Play a gesture on an open base from where it stands, under the same safety as in a session.

    Parameters
    ----------
    gesture
        What to play.
    base
        An open base; a real one is armed by this.
    monotonic, sleep
        The clock [s], and how to wait by it.

    Returns
    -------
    dict
        The outcome, how long it took [s], the pose by odometry, and the true pose, which only a
        simulation knows.

    Raises
    ------
    BaseLost
        Where the base does not answer any more.
    """
    performer = Performer(base)
    began_s = monotonic()
    refused = performer.play_alone(gesture, began_s)
    farthest_m = 0.0
    if not refused:
        performer.tick(began_s)
    for pause_s in control_loop(performer, monotonic, lambda: not performer.player.is_busy):
        farthest_m = max(farthest_m, base.read().pose.distance_m(HOME))
        sleep(pause_s)
    took_s = monotonic() - began_s
    outcome = refused or performer.player.outcome
    for _ in range(round(REST_S / TICK_S)):
        base.stop()
        sleep(TICK_S)
    truth = base.ground_truth()
    return {
        "gesture": gesture.name,
        "base": base.name,
        "abilities": asdict(base.abilities),
        "outcome": outcome,
        "took_s": round(took_s, 3),
        "pose": asdict(base.read().pose),
        "farthest_m": farthest_m,
        "true_pose": None if truth is None else asdict(truth.pose),
        "true_farthest_m": None if truth is None else truth.farthest_m,
    }


def format_result(played: dict[str, Any]) -> str:
    """Return a result as a line for people."""
    pose = played["true_pose"] or played["pose"]
    where = f"x {1000 * pose['x_m']:.0f} mm, y {1000 * pose['y_m']:.0f} mm"
    loop = "" if played["abilities"]["closed_loop"] else ", open loop: where it should be"
    took = f"after {played['took_s']:.1f} s"
    return f"{played['gesture']}: {played['outcome']} {took}, at {where}{loop}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Play the gesture of the command line, and return the exit status."""
    parser = ArgumentParser(
        prog="python -m robot gesture",
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=sorted(GESTURES | ORIGINALS))
    moving = sorted(name for name, base in BASES.items() if base.abilities.moves)
    add_base_arguments(parser, moving)
    parser.add_argument("--times", type=int, default=1, metavar="N", help="so often, in a row")
    parser.add_argument("--json", action="store_true", help="print a JSON line each")
    options = parser.parse_args(arguments)
    clock = VirtualClock()
    is_real = BASES[options.base].abilities.real_time
    monotonic, sleep = (time.monotonic, time.sleep) if is_real else (clock.monotonic, clock.sleep)
    outcome = DONE
    try:
        base = make_base(options, monotonic)
        with base:
            for _ in range(options.times):
                played = play_gesture((GESTURES | ORIGINALS)[options.name], base, monotonic, sleep)
                text = json.dumps(played) if options.json else format_result(played)
                sys.stdout.write(f"{text}\n")
                sys.stdout.flush()
                outcome = played["outcome"]
                if outcome != DONE:
                    if base.problem:
                        sys.stderr.write(f"{base.problem}\n")
                    break
    except BaseLost as problem:
        sys.stderr.write(f"{problem}\n")
        return 1
    except BadOption as problem:
        sys.stderr.write(f"{problem}\n")
        return 2
    except KeyboardInterrupt:
        return 130
    return 0 if outcome == DONE else 1


if __name__ == "__main__":
    sys.exit(main())
