"""`python -m robot replay FILE --base NAME`: gives a simulated base an incident's orders again.

FILE is of a black box, or downloaded from an incident's page. Prints where the base was recorded
and where the simulated one comes to, once a second and at the end: what differs is not explained by
the orders (a push, a slip, a hand). Exit status: 0; 2 the command line or the file cannot be used.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from robot.base_options import (
    add_base_arguments,
    clock_of,
    make_base,
    make_command_parser,
    print_line,
    print_notice,
)
from robot.bases import BASES, BadOption, BaseLost, MobileBase
from robot.motion.limits import TICK_S
from robot.motion.pose import Pose, wrap
from robot.motion.twist import Twist
from robot.wire.incident import TICK, read_aside, read_lines

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
            twist = Twist(v_m_s, w_rad_s, read_aside(record)[0])
            ticks.append((float(record["at_s"]), twist, Pose(*pose)))
    return ticks


def replay(
    ticks: Sequence[tuple[float, Twist, Pose]],
    base: MobileBase,
    monotonic: Callable[[], float],
    sleep: Callable[[float], object],
) -> Iterator[Compared]:
    """Yield where a base is at each tick, while it gets the orders at their times.

    Parameters
    ----------
    ticks
        Times [s], orders and poses, as of ``read_ticks``.
    base
        An open simulated base.
    monotonic, sleep
        The clock [s] that it runs by, and how to wait by it.
    """
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
    parser = make_command_parser("replay", __doc__)
    parser.add_argument("file", type=Path)
    simulated = [n for n, one in BASES.items() if one.abilities.simulated and one.abilities.moves]
    add_base_arguments(parser, sorted(simulated))
    options = parser.parse_args(arguments)
    try:
        ticks = read_ticks(options.file.read_text("utf-8"))
    except (OSError, ValueError) as problem:
        print_notice(f"{options.file} cannot be read: {problem}")
        return 2
    if not ticks:
        print_notice(f"{options.file} has no ticks. Take a file of a black box.")
        return 2
    monotonic, sleep = clock_of(options.base)
    try:
        with make_base(options, monotonic) as base:
            if any(order.vy_m_s for _, order, _ in ticks) and not base.abilities.holonomic:
                raise BadOption(
                    "The recording is of a base that moves sideways: take --base kinematic "
                    "--holonomic."
                )
            printed_s = -math.inf
            for compared in replay(ticks, base, monotonic, sleep):
                if compared.at_s - printed_s >= 1.0:
                    printed_s = compared.at_s
                    print_line(format_compared(compared), sys.stdout)
            print_line(format_compared(compared), sys.stdout)
    except (BadOption, BaseLost) as problem:
        print_notice(str(problem))
        return 2
    return 0


def format_compared(compared: Compared) -> str:
    """Return a line for people."""

    def describe(pose: Pose) -> str:
        turned_deg = math.degrees(wrap(pose.heading_rad))
        return f"{1000 * pose.x_m:5.0f} mm {1000 * pose.y_m:5.0f} mm {turned_deg:6.1f}°"

    apart_mm = 1000 * compared.recorded.distance_m(compared.replayed)
    return (
        f"{compared.at_s:6.2f} s   recorded {describe(compared.recorded)}   "
        f"replayed {describe(compared.replayed)}   apart {apart_mm:.0f} mm"
    )
