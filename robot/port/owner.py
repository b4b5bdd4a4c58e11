"""Keeps a serial port open, and sends the base its orders or the stop."""

from __future__ import annotations

import contextlib
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from robot.port.setpoint import Setpoint

PUMP_S = 0.02
READ_S = 0.005  # how long a read waits: a stop is on its way within that
WORD_S = 0.1  # so often it says that it lives
STOPS = 3  # frames; one may be damaged on its way (docs/reference/kobuki.md#orders)
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.2, 2.0  # before the port is opened again
MOST_BYTES = 4096


class SerialPort(Protocol):
    """What is used of pyserial."""

    def read(self, size: int = 1) -> bytes:
        """Return what came within a moment."""

    def write(self, data: bytes, /) -> int | None:
        """Send bytes."""

    def close(self) -> None:
        """Close it."""


class PortOwner:
    """Keeps a port open, and sends the base its orders. ``run`` returns after ``end``.

    Parameters
    ----------
    open_port
        Opens the port; raises OSError or ValueError.
    stop
        The frame that stops the base.
    tell
        Called with what was received; never waits.
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
        """Handle a line of the orders, from any thread."""
        once = self.setpoint.store(line, self._monotonic())
        if once:
            self._once.append(once)

    def end(self) -> None:
        """Make ``run`` stop the base and return."""
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
