"""`python -m robot.port`: owns a serial port, and stops the base on it when orders stop coming.

A base may go on with its last setpoint forever (docs/reference/kobuki.md#watchdogs). So a small
process of its own sends it, 50 times a second, what was ordered last, and the stop frame as soon as
that is older than 0.25 s, the pipe of the orders closes, or anything else goes wrong here. It knows
no base, only bytes. Orders come on standard input, what was received goes to standard output,
a JSON line each:

    {"number": 7, "sent_s": 12.34, "frame": "aa55…", "once": "aa55…"}
    {"at_s": 12.35, "opened": 1, "bytes": "aa55…", "problem": "", "owes_stop": false,
     "counters": {…}}

``once`` is sent one time. Times are of the computer's monotonic clock, which its processes share.
A port that is lost is opened again as soon as it is back, with stops first. Where it was lost while
the base moved, this process outlives whoever started it until the base is stopped. An orphan stop
(``orphan_stop``) stops the base if this process dies, whether or not its parent lives to do so.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
from argparse import ArgumentParser
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from robot.port.fresh_order import MAX_FRAME_BYTES
from robot.port.opening import PortOpener
from robot.port.orphan_stop import OrphanStop
from robot.port.owner import PortOwner
from robot.port.priority import raise_priority

LINES_KEPT = 25  # received ones, while nobody reads them: half a second


class PipeWriter:
    """Writes lines to a pipe on a thread of its own; drops the oldest ones while nothing reads."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self._lines: deque[bytes] = deque(maxlen=LINES_KEPT)
        self._awake = threading.Event()

    def write(self, report: dict[str, Any]) -> None:
        """Queue a line."""
        self._lines.append(json.dumps(report).encode() + b"\n")
        self._awake.set()

    def run(self, on_end: Callable[[], None]) -> None:
        """Write until the pipe is closed at its other end, then call ``on_end``."""
        with contextlib.suppress(OSError):
            while True:
                self._awake.wait()
                self._awake.clear()
                while self._lines:
                    line = self._lines.popleft()
                    while line:
                        line = line[os.write(self._pipe, line) :]
        on_end()


def listen(pipe: int, order: Callable[[bytes], None], on_end: Callable[[], None]) -> None:
    """Pass each line of a pipe to ``order`` until it closes, then call ``on_end``."""
    rest = b""
    with contextlib.suppress(OSError):
        while data := os.read(pipe, 65536):
            *lines, rest = (rest + data).split(b"\n")
            rest = rest[-MAX_FRAME_BYTES * 8 :]  # no order is longer
            for line in lines:
                order(line)
    on_end()


def main(arguments: Sequence[str] | None = None) -> None:
    """Own the port of the command line until standard input closes or a signal ends it."""
    parser = ArgumentParser(prog="python -m robot.port", description=__doc__)
    parser.add_argument(
        "url",
        nargs="?",
        default="",
        help="/dev/kobuki, COM3, a pty, or socket://host:port (default: a Kobuki that is plugged "
        "in, now or later)",
    )
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--stop", type=bytes.fromhex, required=True, help="the frame that stops it")
    parser.add_argument(
        "--owes-stop", action="store_true", help="the process before this one lost a moving base"
    )
    options = parser.parse_args(arguments)
    raise_priority()
    opener = PortOpener(options.url, options.baud)
    orphan_stop = OrphanStop(opener, options.stop)  # before there are threads
    writer = PipeWriter(sys.stdout.fileno())
    owner = PortOwner(opener, options.stop, writer.write)
    owner.owes_stop = options.owes_stop
    for name in ("SIGTERM", "SIGHUP", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: owner.end())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends our parent: the pipe closes
    orders = partial(listen, sys.stdin.fileno(), owner.order, owner.end)
    for work in (orders, partial(writer.run, owner.end)):
        threading.Thread(target=work, daemon=True).start()
    owner.run()
    orphan_stop.cancel()


if __name__ == "__main__":
    main()
