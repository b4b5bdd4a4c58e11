"""What the command line of a source takes."""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, ArgumentTypeError, RawDescriptionHelpFormatter
from pathlib import Path

from rehab.sources.source import LiveSource, PlayedSource, Source
from rehab.training.steps import Side
from robot.connection_args import add_connection_arguments


def parse_speed(text: str) -> float | None:
    """Return None for `max` and the speed for a finite number above 0."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not 0 < speed < math.inf:
        raise ArgumentTypeError("give max, or a number above 0 (1 for true cadence)")
    return speed


def parse_count(text: str) -> int:
    """Return a whole number above 0."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise ArgumentTypeError("give a whole number above 0")
    return int(text)


def make_parser(name: str, source: type[Source]) -> ArgumentParser:
    """Return the command-line parser of a source."""
    parser = ArgumentParser(
        prog=f"python -m rehab.sources {name}",
        description=sys.modules[source.__module__].__doc__,
        epilog="The token may also be in the environment, as GARRY_TOKEN.",
        formatter_class=RawDescriptionHelpFormatter,
    )
    source.add_arguments(parser)
    server = parser.add_argument_group("the server, and how to walk")
    add_connection_arguments(server)
    server.add_argument(
        "--side",
        choices=[side.value for side in Side],
        help="the leg of strides that name none (default: the session's trained leg)",
    )
    server.add_argument(
        "--session", type=parse_count, metavar="N", help="join this session, not the open one"
    )
    server.add_argument(
        "--stay", action="store_true", help="go on in every later session of the station"
    )
    server.add_argument(
        "--log", type=Path, metavar="FILE", help="append a JSON line for every acknowledgment"
    )
    if issubclass(source, LiveSource):
        server.add_argument(
            "--journal",
            type=Path,
            metavar="FILE",
            help="keep what the server has not stored in this file, over restarts and power cuts",
        )
        server.add_argument(
            "--journal-mb",
            type=parse_count,
            default=64,
            metavar="N",
            help="how large the journal may become (default: 64)",
        )
        parser.add_argument(
            "--check",
            action="store_true",
            help="listen for 30 s while somebody walks, say what the columns are, and end: nothing "
            "is sent to a server",
        )
    if issubclass(source, PlayedSource):
        server.add_argument(
            "--speed",
            type=parse_speed,
            default=1.0,
            metavar="max|N",
            help="N times true cadence (default 1), or max: as fast as the server stores",
        )
        server.add_argument(
            "--resume", action="store_true", help="go on behind what the session has already"
        )
        server.add_argument("--strides", type=parse_count, metavar="N", help="stop after so many")
    return parser
