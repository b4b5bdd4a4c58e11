"""`python -m robot twin`: a simulated Kobuki at a port of its own, which it prints first.

Whatever drives a real Kobuki drives it: the same bytes at the same pace. Standard input takes
orders to the twin itself, a JSON line each, and standard output answers each with one:

    {"do": "set", "name": "bumper", "value": 2, "for_s": 0.5}   a fault; for_s may be left out
    {"do": "stall", "for_s": 0.2}          the line holds everything back
    {"do": "vanish", "for_s": 1}           the port is not there
    {"do": "power_cycle", "for_s": 1}      it is off, then all counters begin at 0
    {"do": "wall", "ahead_m": 0.3}         something to bump into (physics only)
    {"do": "edge", "ahead_m": 0.3}         something to fall from (physics only)
    {"do": "carry_home"}                   as a person would, to where it began
    {"do": "look"}                         the truth, and the setpoints since the last look

It ends at SIGTERM or Ctrl-C; with --child, also when standard input closes.
"""

from __future__ import annotations

import contextlib
import os
import queue
import random
import signal
import sys
import threading
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path

from robot.bases.kobuki_protocol.feedback import Version
from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.twin.bodies import KinematicBody, WheeledBody
from robot.bases.twin.bullet import BulletBody, redirect_output
from robot.bases.twin.faults import BadFault, Faults
from robot.bases.twin.firmware import FIRMWARE, Firmware
from robot.bases.twin.lines import Line, PtyLine, SocketLine
from robot.bases.twin.picture_process import Camera
from robot.bases.twin.process import Twin


def make_body(name: str, notice: Callable[[str], None]) -> WheeledBody:
    """Return a body of the twin.

    Parameters
    ----------
    name
        ``bullet`` (with physics), ``kinematic``, or ``auto`` for the first of them that is
        installed.
    notice
        Called with a line for people where ``auto`` finds no physics.

    Raises
    ------
    ImportError
        For ``bullet`` where pybullet is not installed.
    """
    if name != "kinematic":
        try:
            return BulletBody(FRAME_S)
        except ImportError:
            if name == "bullet":
                raise
            notice(
                "pybullet is not installed: the twin rolls as arithmetic says, and touches "
                "nothing. Cure: pip install 'garry[twin]' (CPython 3.11 on Linux x86_64)."
            )
    return KinematicBody(FRAME_S)


def print_notice(text: str) -> None:
    """Print a line to standard error."""
    print(text, file=sys.stderr, flush=True)


def read_version(text: str) -> Version:
    """Read a version, such as 1.1.4. Raises ValueError."""
    major, minor, patch = map(int, text.split("."))
    if not all(0 <= part <= 255 for part in (major, minor, patch)):
        raise ValueError(text)
    return Version(major, minor, patch)


def make_parser() -> ArgumentParser:
    """Return the command line's parser."""
    parser = ArgumentParser(
        prog="python -m robot twin",
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--line",
        choices=["pty", "socket"],
        default="pty" if hasattr(os, "openpty") else "socket",
        help="what its port is (default: a pseudo-terminal where there are any)",
    )
    parser.add_argument("--socket-port", type=int, default=0, metavar="N", help="of --line socket")
    parser.add_argument("--body", choices=["auto", "bullet", "kinematic"], default="auto")
    parser.add_argument("--firmware", type=read_version, default=FIRMWARE, metavar="1.2.0")
    parser.add_argument(
        "--watchdog-s",
        type=float,
        metavar="S",
        help="stop after so long without a setpoint (default: never, as a real one)",
    )
    parser.add_argument("--seed", type=int, help="of the line's faults")
    parser.add_argument(
        "--camera",
        type=Path,
        metavar="FILE",
        help="keep a picture of it there (PNG, five a second at most; needs pybullet)",
    )
    parser.add_argument(
        "--tag",
        type=int,
        metavar="N",
        help="with --camera: keep a picture there of what a camera on it sees of a room with tag N "
        "(needs pybullet and OpenCV)",
    )
    parser.add_argument("--child", action="store_true", help="end when standard input closes")
    faults = parser.add_argument_group("faults from the beginning")
    for fault in fields(Faults):
        kind = type(fault.default)
        faults.add_argument(
            f"--{fault.name.replace('_', '-')}", type=kind, default=fault.default, metavar="N"
        )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the twin of the command line until it is stopped, and return the exit status."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    if options.camera and not (find_spec("pybullet") and find_spec("PIL")):
        parser.error(
            "--camera needs pybullet and pillow. Cure: pip install 'garry[twin]', or do without."
        )
    if options.tag is not None and not (options.camera and find_spec("cv2")):
        parser.error("--tag needs --camera, and OpenCV. Cure: pip install 'garry[tag]'.")
    if options.camera and not options.camera.parent.is_dir():
        parser.error(f"--camera: there is no folder {options.camera.parent}. Make it first.")
    faults = Faults()
    try:
        for fault in fields(Faults):
            faults.change(fault.name, getattr(options, fault.name))
    except BadFault as problem:
        parser.error(str(problem))
    answers = redirect_output()

    def answer(text: str) -> None:
        os.write(answers, text.encode() + b"\n")

    try:
        body = make_body(options.body, print_notice)
    except ImportError as problem:
        parser.error(f"{problem}. Cure: --body kinematic, or pip install 'garry[twin]'.")
    chance = random.Random(options.seed)  # noqa: S311 (nothing here is a secret)
    firmware = Firmware(body, faults, options.firmware, options.watchdog_s, chance=chance)
    port: Line = PtyLine() if options.line == "pty" else SocketLine(options.socket_port)
    over = threading.Event()
    for name in ("SIGTERM", "SIGINT"):
        signal.signal(getattr(signal, name), lambda *_: over.set())
    orders: queue.Queue[str] = queue.Queue()

    def read_orders() -> None:
        # Not by sys.stdin: its lock, held by a thread that waits, would break our ending.
        rest = b""
        with contextlib.suppress(OSError):
            while data := os.read(0, 65536):
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    orders.put(line.decode(errors="replace"))
        if options.child:
            over.set()

    threading.Thread(target=read_orders, daemon=True).start()
    camera: AbstractContextManager[object] = nullcontext()
    if options.camera:
        camera = Camera(options.camera, lambda: body.pose, options.tag)
    try:
        answer(port.name)
        with camera:
            Twin(firmware, port).run(orders, answer, over.is_set)
    except BrokenPipeError:
        pass  # the reader of the answers is gone
    finally:
        port.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
