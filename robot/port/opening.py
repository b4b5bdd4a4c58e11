"""Opens a serial port: by its name, or that of a Kobuki that is plugged in."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Callable

from robot.port.owner import READ_S, STOPS, SerialPort
from robot.port.usb import find_port

WRITE_S = 0.1  # a port that accepts nothing for this long is lost
LOOK_EVERY_S = 0.25  # for a Kobuki that is plugged in; to list all ports takes a few milliseconds


class PortOpener:
    """Opens a port, each time it is called, for us alone.

    Parameters
    ----------
    url
        /dev/…, COM…, a pty or socket://host:port; empty for a Kobuki's, which may come later and
        under another name.
    baud
        Speed of the line [bit/s].
    find
        Returns the name of a Kobuki's port.
    monotonic
        The clock [s].
    """

    def __init__(
        self,
        url: str,
        baud: int,
        find: Callable[[], str] = find_port,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._url, self._baud, self._find, self._monotonic = url, baud, find, monotonic
        self._found, self._looked_s = "", -math.inf

    @property
    def url(self) -> str:
        """The port to open next."""
        if self._url:
            return self._url
        now_s = self._monotonic()
        if now_s - self._looked_s >= LOOK_EVERY_S:
            self._found, self._looked_s = self._find(), now_s
        return self._found

    def __call__(self) -> SerialPort:
        """Open it. Raises OSError and ValueError."""
        import serial

        port = serial.serial_for_url(
            self.url, baudrate=self._baud, timeout=READ_S, write_timeout=WRITE_S, exclusive=True
        )
        if sys.platform != "win32" and isinstance(port, serial.Serial):
            from robot.port.exclusive import claim

            try:
                claim(port.fileno())
            except OSError:
                port.close()
                raise
        # Not every port has this mode: a pty and a socket have no chip with a timer.
        with contextlib.suppress(OSError, ValueError, AttributeError, NotImplementedError):
            port.set_low_latency_mode(True)
        return port


def send_stops(open_port: Callable[[], SerialPort], stop: bytes) -> bool:
    """Stop the base at a port that nobody has open, and return whether it could. Never raises."""
    with contextlib.suppress(Exception):  # whatever a driver may raise: the port is lost
        port = open_port()
        try:
            for _ in range(STOPS):
                port.write(stop)
        finally:
            port.close()
        return True
    return False
