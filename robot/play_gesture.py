"""`python -m robot gesture NAME --base BASE`: plays a gesture without a server.

For trying a base and its place. Running it arms a real base: stand at its switch.
Exit status: 0 it was played; 1 it ended otherwise, or the base does not answer; 2 the command line
cannot be used; 128 + N ended by signal N (Ctrl-C: 130). However it ends, the base is stopped; one
whose connection was lost meanwhile as soon as it is back.
"""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from robot.base_options import (
    add_base_arguments,
    clock_of,
    make_base,
    make_command_parser,
    print_line,
    print_notice,
)
from robot.bases import BASES, BadOption, BaseLost, MobileBase
from robot.behavior.control_loop import control_loop
from robot.behavior.performer import Performer
from robot.behavior.safety import BASE_SILENT, BASE_SILENT_S
from robot.calibration import BadCalibration, apply_calibration
from robot.motion.gesture import Gesture
from robot.motion.gestures import BUILT_IN
from robot.motion.limits import TICK_S
from robot.motion.player import DONE
from robot.motion.pose import HOME

REST_S = 0.3  # until wheels, odometry and true pose have come to rest
LOST_S = 60.0  # a base that was lost is waited for so long; a person has switched it off by then
ENDINGS = ("SIGTERM", "SIGHUP", "SIGBREAK", "SIGINT")  # those that this system has


class Ended(BaseException):
    """A signal ended the program; its number is the argument."""


@contextmanager
def ending_by_signals() -> Iterator[None]:
    """Let each signal that ends a program raise Ended, so that its base is stopped."""

    ended: list[int] = []

    def end(number: int, _frame: object) -> None:
        """Raise Ended for the first signal, of this ``number``; ``_frame`` is not used."""
        ended.append(number)
        if len(ended) == 1:  # what follows would disturb the stopping
            raise Ended(number)

    names = [getattr(signal, name) for name in ENDINGS if hasattr(signal, name)]
    had = {name: signal.signal(name, end) for name in names}
    try:
        yield
    finally:
        for name, handler in had.items():
            signal.signal(name, handler)


def wait_for_stop(
    base: MobileBase, monotonic: Callable[[], float], sleep: Callable[[float], object]
) -> bool:
    """Order a base that does not answer to stand until it does; return whether it did.

    Parameters
    ----------
    base
        An open base.
    monotonic, sleep
        The clock [s], and how to wait by it.
    """
    until_s = monotonic() + LOST_S
    while base.read().sensors.silent_s > BASE_SILENT_S:
        if monotonic() >= until_s:
            return False
        base.stop()
        sleep(TICK_S)
    return True


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
        Whether it began, its outcome, how long it took [s], the pose by odometry, and the true
        pose, which only a simulation knows.

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
    for pause_s in control_loop(performer, monotonic, lambda: not performer.body.player.is_busy):
        farthest_m = max(farthest_m, performer.body.state.pose.distance_m(HOME))
        sleep(pause_s)
    took_s = monotonic() - began_s
    outcome = refused or performer.body.player.outcome
    for _ in range(round(REST_S / TICK_S)):
        base.stop()
        sleep(TICK_S)
    truth = base.ground_truth()
    return {
        "gesture": gesture.name,
        "base": base.name,
        "abilities": asdict(base.abilities),
        "began": not refused,
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
    parser = make_command_parser("gesture", __doc__)
    parser.add_argument(
        "name", choices=sorted(BUILT_IN), metavar="NAME", help="celebrate, joy_1, …"
    )
    moving = sorted(name for name, base in BASES.items() if base.abilities.moves)
    add_base_arguments(parser, moving)
    parser.add_argument("--times", type=int, default=1, metavar="N", help="so often, in a row")
    parser.add_argument("--json", action="store_true", help="print a JSON line each")
    options = parser.parse_args(arguments)
    monotonic, sleep = clock_of(options.base)
    outcome = DONE
    try:
        base = make_base(options, monotonic)
        with ending_by_signals(), base:
            apply_calibration(base)
            for _ in range(options.times):
                played = play_gesture(BUILT_IN[options.name], base, monotonic, sleep)
                text = json.dumps(played) if options.json else format_result(played)
                print_line(text, sys.stdout)
                outcome = played["outcome"]
                if outcome != DONE:
                    print_notice(base.problem)
                    break
            if outcome == BASE_SILENT and played["began"]:
                print_notice("It may be moving: switch it off. Waiting for it, to stop it.")
                if wait_for_stop(base, monotonic, sleep):
                    print_notice("It answers again, and was stopped.")
    except BaseLost as problem:
        print_notice(str(problem))
        return 1
    except (BadCalibration, BadOption) as problem:
        print_notice(str(problem))
        return 2
    except Ended as end:
        return 128 + int(end.args[0])
    return 0 if outcome == DONE else 1
