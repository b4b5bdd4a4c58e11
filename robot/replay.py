"""`python -m robot replay FILE --base NAME`: gives a simulated base an incident's orders again.

FILE is of a black box, or downloaded from an incident's page. Prints where the base was recorded
and where the simulated one comes to, once a second and at the end: what differs is not explained by
the orders (a push, a slip, a hand). Exit status: 0; 2 the command line or the file cannot be used.
"""

from __future__ import annotations

import math
import sys
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from robot.base_options import add_base_arguments, make_base
from robot.bases import BASES, BadOption, BaseLost, MobileBase
from robot.motion.limits import TICK_S
from robot.motion.pose import Pose, wrap
from robot.motion.twist import Twist
from robot.play_gesture import VirtualClock, print_line
from robot.wire.incident import TICK, read_lines

SETTLE_S = 0.3  # of a base that was just opened


class Compared(NamedTuple):
    """Where a base was, and where a simulated one comes to, each from where it began."""

    at_s: float
    recorded: Pose
    replayed: Pose


def read_ticks(text: str) -> list[tuple[float, Twist, Pose]]:
    """Return times, orders and poses of a recording's ticks."""
    ticks: list[tuple[float, Twist, Pose]] = []
    for record in read_lines(text):
        numbers: Any = record.get("tick")
        if isinstance(numbers, list) and len(numbers) == len(TICK):
            v_m_s, w_rad_s, *pose, _, _ = map(float, numbers)
            ticks.append((float(record["at_s"]), Twist(v_m_s, w_rad_s), Pose(*pose)))
    return ticks


def replay(
    ticks: Sequence[tuple[float, Twist, Pose]],
    base: MobileBase,
    monotonic: Callable[[], float],
    sleep: Callable[[float], object],
) -> Iterator[Compared]:
    """Yield where a base is at each tick, while it gets the orders at their times."""
    until_s = monotonic() + SETTLE_S
    while monotonic() < until_s:
        base.stop()
        sleep(TICK_S)
    base.set_home()
    began_s, (first_s, order, start) = monotonic(), ticks[0]
    for at_s, following, pose in ticks:
        while monotonic() - began_s < at_s - first_s - TICK_S / 2:
            base.drive(order)  # an order holds for a moment only
            sleep(TICK_S)
        replayed = base.read().pose
        order = following
        base.drive(order)
        yield Compared(at_s - first_s, pose.seen_from(start), replayed)
    base.stop()


def main(arguments: Sequence[str] | None = None) -> int:
    """Replay the file of the command line, and return the exit status."""
    parser = ArgumentParser(
        prog="python -m robot replay",
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", type=Path)
    simulated = [n for n, one in BASES.items() if one.abilities.simulated and one.abilities.moves]
    add_base_arguments(parser, sorted(simulated))
    options = parser.parse_args(arguments)
    try:
        ticks = read_ticks(options.file.read_text("utf-8"))
    except (OSError, ValueError) as problem:
        print_line(f"{options.file} cannot be read: {problem}", sys.stderr)
        return 2
    if not ticks:
        print_line(f"{options.file} has no ticks. Take a file of a black box.", sys.stderr)
        return 2
    clock = VirtualClock()
    is_real = BASES[options.base].abilities.real_time
    monotonic, sleep = (time.monotonic, time.sleep) if is_real else (clock.monotonic, clock.sleep)
    try:
        with make_base(options, monotonic) as base:
            told_s = -math.inf
            for compared in replay(ticks, base, monotonic, sleep):
                if compared.at_s - told_s >= 1.0:
                    told_s = compared.at_s
                    print_line(format_compared(compared), sys.stdout)
            print_line(format_compared(compared), sys.stdout)
    except (BadOption, BaseLost) as problem:
        print_line(str(problem), sys.stderr)
        return 2
    return 0


def format_compared(compared: Compared) -> str:
    """Return a line for people."""

    def told(pose: Pose) -> str:
        turned_deg = math.degrees(wrap(pose.heading_rad))
        return f"{1000 * pose.x_m:5.0f} mm {1000 * pose.y_m:5.0f} mm {turned_deg:6.1f}°"

    apart_mm = 1000 * compared.recorded.distance_m(compared.replayed)
    return (
        f"{compared.at_s:6.2f} s   recorded {told(compared.recorded)}   "
        f"replayed {told(compared.replayed)}   apart {apart_mm:.0f} mm"
    )


if __name__ == "__main__":
    sys.exit(main())
