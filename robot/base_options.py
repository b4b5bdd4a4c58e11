"""The base of a command line: which one, its address and its options."""

from __future__ import annotations

import sys
import time
from argparse import (
    ArgumentParser,
    ArgumentTypeError,
    Namespace,
    RawDescriptionHelpFormatter,
)
from collections.abc import Callable, Collection
from typing import TextIO

from robot.bases import BASES, MobileBase
from robot.ros.rosbridge_connection import find_bridge, is_address


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


def clock_of(base: str) -> tuple[Callable[[], float], Callable[[float], None]]:
    """Return the clock [s] that a base runs by, and how to wait by it [s].

    It is the computer's, or a virtual one for a base that does not run in real time.
    """
    if BASES[base].abilities.real_time:
        return time.monotonic, time.sleep
    clock = VirtualClock()
    return clock.monotonic, clock.sleep


def make_command_parser(name: str, description: str | None) -> ArgumentParser:
    """Return the parser of `python -m robot NAME`, without arguments yet."""
    return ArgumentParser(
        prog=f"python -m robot {name}".rstrip(),
        description=description,
        formatter_class=RawDescriptionHelpFormatter,
    )


def print_line(text: str, file: TextIO) -> None:
    """Print a line, unless it is empty."""
    if text:
        print(text, file=file, flush=True)


def print_notice(text: str) -> None:
    """Print a line to standard error, unless it is empty."""
    print_line(text, sys.stderr)


def add_base_arguments(parser: ArgumentParser, names: Collection[str] = BASES) -> None:
    """Add the choice of one of these bases, and their options, to a command line."""
    parser.add_argument("--base", required=True, choices=sorted(names), help="what to drive")
    parser.add_argument(
        "--port",
        default="",
        help="where a Kobuki is: /dev/kobuki, COM3, socket://host:port (default: "
        "GARRY_ROBOT_PORT, or one that is plugged in)",
    )
    parser.add_argument(
        "--ros-url",
        type=_read_address,
        default=find_bridge(),
        metavar="URL",
        help="where a rosbridge is (default: GARRY_ROS_URL, or ws://127.0.0.1:9090)",
    )
    for feeling, window in (("glad", "strong"), ("sad", "weak")):
        parser.add_argument(
            f"--say-{feeling}",
            default="",
            metavar="WORDS",
            help=f"what a base that talks says to a {window} window",
        )
    parser.add_argument(
        "--face-port",
        type=int,
        metavar="N",
        help="show a face for a screen on a Kobuki's mast at http://HOST:N/?face (default: none)",
    )
    parser.add_argument(
        "--face-host",
        default="127.0.0.1",
        help="who may open that page: 127.0.0.1 this computer, 0.0.0.0 every one in its network",
    )
    for name in names:
        BASES[name].add_arguments(parser.add_argument_group(f"--base {name}"))


def _read_address(text: str) -> str:
    if not is_address(text):
        raise ArgumentTypeError(f"{text!r} is no address. Write ws://192.168.1.20:9090.")
    return text


def make_base(options: Namespace, monotonic: Callable[[], float]) -> MobileBase:
    """Return the base of a command line, not open yet. Raises BadOption."""
    base = BASES[options.base](monotonic)
    base.configure(options)
    return base
