"""Opens a serial port: by its name, or that of a Kobuki that is plugged in."""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable

from robot.port.owner import READ_S, STOPS, SerialPort
from robot.port.usb import find_port

PTYS = ("/dev/pts/", "/dev/ttys")
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
    """Stop the base at a port that nobody has open, and return whether it could. Never raises.

    Parameters
    ----------
    open_port
        Opens the port; may raise anything.
    stop
        The frame that stops the base.
    """
    with contextlib.suppress(Exception):  # whatever a driver may raise: the port is lost
        port = open_port()
        try:
            for _ in range(STOPS):
                port.write(stop)
        finally:
            port.close()
        return True
    return False


def claim(port: int) -> None:
    """Lock an open port, given its file descriptor. Raises OSError where another program has it.

    pyserial's own lock is ``flock``; kobuki_node takes one by ``fcntl``, and neither sees the other
    (docs/reference/kobuki.md#serial-link). ``TIOCEXCL`` keeps everybody else from opening it at
    all. The modules are POSIX's: Windows lacks them, and needs none of this.

    A pty, the port of a twin, is left without ``TIOCEXCL``: it would keep that after we are killed,
    because the twin has it open too, and nobody could ever open it again.
    """
    import fcntl

    try:
        fcntl.lockf(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as problem:
        raise OSError(
            problem.errno, "another program has locked the port (kobuki_node?). Stop that one"
        ) from None
    if not os.ttyname(port).startswith(PTYS):
        refuse_others(port)


def refuse_others(port: int) -> None:
    """Let no other program open a port while we have it; a superuser's still may."""
    import fcntl
    import termios

    fcntl.ioctl(port, termios.TIOCEXCL)
