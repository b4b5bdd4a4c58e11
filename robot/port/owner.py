"""Keeps a serial port open, and sends the base its orders or the stop."""

from __future__ import annotations

import contextlib
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from robot.port.fresh_order import FreshOrder

SEND_EVERY_S = 0.02
READ_S = 0.005  # how long a read waits; a stop is delayed by at most that
REPORT_EVERY_S = 0.1  # also where nothing was received
STOPS = 3  # frames; one may be damaged on its way (docs/reference/kobuki.md#orders)
RETRY_S = 0.05  # a base whose port is lost may be moving: it is opened again as soon as it is back
# A port may be lost unnoticed for a moment, and a stop with it: one that took motion less than so
# many stop frames ago (half a second of them) is owed a stop when it is back.
SURE_STOPS = 25
LEAVE_S = 300.0  # how long that is tried after the end; a person has pulled the switch by then
MAX_READ_BYTES = 4096


class SerialPort(Protocol):
    """The part of a pyserial port that is used here."""

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
    report
        Called with what was received; never waits.
    monotonic, sleep
        The computer's clock [s], and how to wait by it.
    """

    def __init__(
        self,
        open_port: Callable[[], SerialPort],
        stop: bytes,
        report: Callable[[dict[str, Any]], None],
        *,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.fresh_order = FreshOrder(stop)
        self.opened = 0
        self.problem = "The port has not been opened yet."
        self._open_port = open_port
        self._report = report
        self._monotonic = monotonic
        self._sleep = sleep
        self._port: SerialPort | None = None
        self._once: deque[bytes] = deque(maxlen=8)
        self._sent, self._sent_s, self._reported_s = b"", -math.inf, -math.inf
        self._open_at_s = -math.inf
        self._unsure = 0  # so many more stop frames, and the base has certainly heard one
        self._is_over = False

    def order(self, line: bytes) -> None:
        """Handle a line of the orders, from any thread."""
        once = self.fresh_order.store(line, self._monotonic())
        if once:
            self._once.append(once)

    @property
    def owes_stop(self) -> bool:
        """Whether the port was lost while the base moved: it may be moving still."""
        return self._port is None and self._unsure > 0

    @owes_stop.setter
    def owes_stop(self, owes: bool) -> None:
        self._unsure = SURE_STOPS if owes else 0

    def end(self) -> None:
        """Make ``run`` stop the base and return; where it cannot be reached, for ``LEAVE_S``."""
        self._is_over = True

    def run(self) -> None:
        """Own the port until ``end`` is called. However it ends, the base is stopped."""
        try:
            while not self._is_over:
                self._try(self._step)
            leave_s = self._monotonic() + LEAVE_S
            while self._port is not None or (self.owes_stop and self._monotonic() < leave_s):
                self._try(self._step if self._port is None else self._leave)
        finally:
            with contextlib.suppress(Exception):  # a port that is gone takes no stop
                self._send_stops()
            self._close()

    def _try(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as problem:  # whatever a driver may raise: the port is lost
            self._handle_failure(problem)

    def _leave(self) -> None:
        self._send_stops()
        self._close()

    def _step(self) -> None:
        """Read and write once, or try to open the port."""
        now_s, data = self._monotonic(), b""
        if self._port is not None:
            data = self._port.read(MAX_READ_BYTES)
            now_s = self._monotonic()
            self._send_due(self._port, now_s)
        elif now_s >= self._open_at_s:
            self._port = self._open_port()
            self.opened, self.problem = self.opened + 1, ""
            self.fresh_order.hold()
            self._once.clear()
            self._send_stops()
        else:
            self._sleep(SEND_EVERY_S)
        if data or now_s - self._reported_s >= REPORT_EVERY_S:
            self._reported_s = now_s
            self._report(
                {
                    "at_s": now_s,
                    "opened": self.opened,
                    "bytes": data.hex(),
                    "problem": self.problem,
                    "owes_stop": self.owes_stop,
                    "counters": dict(self.fresh_order.counters),
                }
            )

    def _send_due(self, port: SerialPort, now_s: float) -> None:
        while self._once:
            port.write(self._once.popleft())
        frame = self.fresh_order.frame(now_s)
        if frame != self._sent or now_s - self._sent_s >= SEND_EVERY_S - READ_S / 2:
            port.write(frame)
            self._sent, self._sent_s = frame, now_s
            is_stop = frame == self.fresh_order.stop
            self._unsure = max(self._unsure - 1, 0) if is_stop else SURE_STOPS

    def _send_stops(self) -> None:
        if self._port is not None:
            for _ in range(STOPS):
                self._port.write(self.fresh_order.stop)
            self._unsure = 0

    def _handle_failure(self, problem: Exception) -> None:
        self.problem = f"{problem}"[:300] or type(problem).__name__
        self._close()
        self.fresh_order.hold()
        self._open_at_s = self._monotonic() + RETRY_S
        self._reported_s = -math.inf

    def _close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(Exception):
                port.close()
