"""`python -m robot.port`: owns a serial port, and stops what hangs on it when nobody orders it.

A base may go on with its last setpoint for ever (docs/reference/kobuki.md#watchdogs). So a small
process of its own sends it, 50 times a second, what was ordered last, and the stop frame as soon as
that is older than 0.25 s, the pipe of the orders closes, or anything at all goes wrong here. It
knows no base, only bytes. Orders come on standard input, what was heard goes to standard output, a
JSON line each:

    {"number": 7, "sent_s": 12.34, "frame": "aa55…", "once": "aa55…"}
    {"at_s": 12.35, "opened": 1, "bytes": "aa55…", "problem": "", "counters": {…}}

``once`` is sent one time. Times are of the computer's monotonic clock, which its processes share.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import sys
import threading
import time
from argparse import ArgumentParser
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

from robot.setpoint import LONGEST_FRAME, Setpoint

PUMP_S = 0.02
READ_S = 0.005  # how long a read waits: a stop is on its way within that
WRITE_S = 0.1  # a port that takes nothing for so long is lost
WORD_S = 0.1  # so often it says that it lives
STOPS = 3  # frames; one may be damaged on its way (docs/reference/kobuki.md#orders)
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.2, 2.0  # before the port is opened again
MOST_BYTES = 4096
LINES_KEPT = 25  # of what was heard, while nobody reads it: half a second


class SerialPort(Protocol):
    """What is used of pyserial."""

    def read(self, size: int = 1) -> bytes:
        """Give what came within a moment."""

    def write(self, data: bytes, /) -> int | None:
        """Send bytes."""

    def close(self) -> None:
        """Give it back."""


class PortOwner:
    """Keeps a port open and what hangs on it ordered. ``run`` returns after ``end``.

    Parameters
    ----------
    open_port
        Opens the port; raises OSError or ValueError.
    stop
        The frame that stops the base.
    tell
        Takes what was heard; never waits.
    monotonic, sleep
        The computer's clock [s], and how to wait by it.
    """

    def __init__(
        self,
        open_port: Callable[[], SerialPort],
        stop: bytes,
        tell: Callable[[dict[str, Any]], None],
        *,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.setpoint = Setpoint(stop)
        self.opened = 0
        self.problem = "The port has not been opened yet."
        self._open_port = open_port
        self._tell = tell
        self._monotonic = monotonic
        self._sleep = sleep
        self._port: SerialPort | None = None
        self._once: deque[bytes] = deque(maxlen=8)
        self._sent, self._sent_s, self._told_s = b"", -math.inf, -math.inf
        self._pause_s, self._open_at_s = FIRST_PAUSE_S, -math.inf
        self._is_over = False

    def order(self, line: bytes) -> None:
        """Take a line of the orders, from any thread."""
        once = self.setpoint.take(line, self._monotonic())
        if once:
            self._once.append(once)

    def end(self) -> None:
        """Let ``run`` stop the base and return."""
        self._is_over = True

    def run(self) -> None:
        """Own the port until told to end. However it ends, the base is stopped."""
        try:
            while not self._is_over:
                try:
                    self._turn()
                except Exception as problem:  # whatever a driver may raise: the port is lost
                    self._lose(problem)
        finally:
            self._send_stops()
            self._close()

    def _turn(self) -> None:
        """Read and write once, or try to open the port."""
        now_s, heard = self._monotonic(), b""
        if self._port is not None:
            heard = self._port.read(MOST_BYTES)
            now_s = self._monotonic()
            if heard:
                self._pause_s = FIRST_PAUSE_S
            self._pump(self._port, now_s)
        elif now_s >= self._open_at_s:
            self._port = self._open_port()
            self.opened, self.problem = self.opened + 1, ""
            self.setpoint.hold()
            self._once.clear()
            self._send_stops()
        else:
            self._sleep(PUMP_S)
        if heard or now_s - self._told_s >= WORD_S:
            self._told_s = now_s
            self._tell(
                {
                    "at_s": now_s,
                    "opened": self.opened,
                    "bytes": heard.hex(),
                    "problem": self.problem,
                    "counters": dict(self.setpoint.counters),
                }
            )

    def _pump(self, port: SerialPort, now_s: float) -> None:
        while self._once:
            port.write(self._once.popleft())
        frame = self.setpoint.frame(now_s)
        if frame != self._sent or now_s - self._sent_s >= PUMP_S - READ_S / 2:
            port.write(frame)
            self._sent, self._sent_s = frame, now_s

    def _send_stops(self) -> None:
        with contextlib.suppress(Exception):  # a port that is gone takes no stop
            for _ in range(STOPS if self._port is not None else 0):
                self._port.write(self.setpoint.stop)  # type: ignore[union-attr]

    def _lose(self, problem: Exception) -> None:
        self.problem = f"{problem}"[:300] or type(problem).__name__
        self._close()
        self.setpoint.hold()
        self._open_at_s = self._monotonic() + self._pause_s
        self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)
        self._told_s = -math.inf

    def _close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(Exception):
                port.close()


class Teller:
    """Writes lines to a pipe on a thread of its own; drops the oldest while nobody reads."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self._lines: deque[bytes] = deque(maxlen=LINES_KEPT)
        self._awake = threading.Event()

    def tell(self, said: dict[str, Any]) -> None:
        """Have it written soon."""
        self._lines.append(json.dumps(said).encode() + b"\n")
        self._awake.set()

    def run(self, on_end: Callable[[], None]) -> None:
        """Write until nobody is there to read any more, which is the end."""
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
    """Pass on each line of a pipe until it closes, which is the end."""
    rest = b""
    with contextlib.suppress(OSError):
        while data := os.read(pipe, 65536):
            *lines, rest = (rest + data).split(b"\n")
            rest = rest[-LONGEST_FRAME * 8 :]  # no order is longer
            for line in lines:
                order(line)
    on_end()


def open_serial(url: str, baud: int) -> SerialPort:
    """Open /dev/…, COM…, a pty or socket://host:port, for us alone. Raises OSError, ValueError."""
    import serial

    port = serial.serial_for_url(
        url, baudrate=baud, timeout=READ_S, write_timeout=WRITE_S, exclusive=True
    )
    # Not every port can: a pty and a socket have no chip that would wait.
    with contextlib.suppress(OSError, ValueError, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)
    return port


def main(arguments: Sequence[str] | None = None) -> None:
    """Own the port of the command line until standard input closes or we are told to end."""
    parser = ArgumentParser(prog="python -m robot.port", description=__doc__)
    parser.add_argument("url", help="/dev/kobuki, COM3, a pty, or socket://host:port")
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--stop", type=bytes.fromhex, required=True, help="the frame that stops it")
    options = parser.parse_args(arguments)
    teller = Teller(sys.stdout.fileno())
    owner = PortOwner(partial(open_serial, options.url, options.baud), options.stop, teller.tell)
    for name in ("SIGTERM", "SIGHUP", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: owner.end())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who orders: the pipe closes then
    orders = partial(listen, sys.stdin.fileno(), owner.order, owner.end)
    for work in (orders, partial(teller.run, owner.end)):
        threading.Thread(target=work, daemon=True).start()
    owner.run()


if __name__ == "__main__":
    main()
