"""Where the twin is plugged in: a pseudo-terminal, or a local socket."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

# A pty that is not read for this many frames is emptied, so that a driver that opens it reads the
# present: a real port loses what it receives while it is not open, too.
UNREAD_FRAMES = 10
READ_SIZE = 4096


class Line(Protocol):
    """A port. Nothing here waits, and a driver that is not there is no error.

    Attributes
    ----------
    name
        What a driver opens, by pyserial's ``serial_for_url``.
    """

    name: str

    def plug_in(self) -> None:
        """Make the port appear."""

    def pull_out(self) -> None:
        """Make the port vanish."""

    def write(self, data: bytes) -> None:
        """Send bytes; what does not fit is lost."""

    def read(self) -> bytes:
        """Return what came in."""

    def wait(self, for_s: float) -> None:
        """Wait for bytes, or at most so long [s]."""

    def close(self) -> None:
        """Remove the port for good."""


class PtyLine:
    """A pseudo-terminal under a name that stays the same, as /dev/kobuki does. Not on Windows."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="garry-twin-")
        self.name = str(Path(self._folder.name) / "kobuki")
        self._master = self._slave = -1
        self._unread = 0
        self.plug_in()

    def plug_in(self) -> None:
        """Make the port appear."""
        if self._master >= 0:
            return
        import tty

        self._master, self._slave = os.openpty()
        # Our own end of it stays open: else reading fails whenever no driver has it open.
        tty.setraw(self._slave)
        for end in (self._master, self._slave):
            os.set_blocking(end, False)
        Path(self.name).symlink_to(os.ttyname(self._slave))

    def pull_out(self) -> None:
        """Make the port vanish."""
        if self._master >= 0:
            Path(self.name).unlink(missing_ok=True)
            os.close(self._slave)
            os.close(self._master)
            self._master = self._slave = -1

    def write(self, data: bytes) -> None:
        """Send bytes; what does not fit is lost."""
        if self._master < 0 or not data:
            return
        is_unread = bool(select.select([self._slave], [], [], 0)[0])
        self._unread = self._unread + 1 if is_unread else 0
        with contextlib.suppress(OSError):
            if self._unread > UNREAD_FRAMES:
                os.read(self._slave, READ_SIZE)
            os.write(self._master, data)

    def read(self) -> bytes:
        """Return what came in."""
        with contextlib.suppress(OSError):
            return os.read(self._master, READ_SIZE)
        return b""

    def wait(self, for_s: float) -> None:
        """Wait for bytes, or at most so long [s]."""
        _wait_for([self._master] if self._master >= 0 else [], for_s)

    def close(self) -> None:
        """Remove the port for good."""
        self.pull_out()
        self._folder.cleanup()


class SocketLine:
    """A socket of this computer, for one driver at a time: a second one is turned away."""

    def __init__(self, port: int = 0) -> None:
        self._address = ("127.0.0.1", port)
        self._listener: socket.socket | None = None
        self._driver: socket.socket | None = None
        self.plug_in()
        self.name = f"socket://127.0.0.1:{self._address[1]}"

    def plug_in(self) -> None:
        """Make the port appear, with the same number as before."""
        if self._listener is not None:
            return
        self._listener = socket.create_server(self._address, backlog=1)
        self._listener.setblocking(False)
        self._address = self._listener.getsockname()

    def pull_out(self) -> None:
        """Make the port vanish."""
        for end in (self._listener, self._driver):
            if end is not None:
                end.close()
        self._listener = self._driver = None

    def write(self, data: bytes) -> None:
        """Send bytes; what does not fit is lost."""
        if self._driver is not None and data:
            try:
                self._driver.send(data)
            except BlockingIOError:
                return
            except OSError:
                self._disconnect()

    def read(self) -> bytes:
        """Return what came in, and accept the next driver where there is none."""
        data = b""
        if self._driver is not None:
            try:
                data = self._driver.recv(READ_SIZE)
            except BlockingIOError:
                pass
            except OSError:
                self._disconnect()
            else:
                if not data:
                    self._disconnect()
        self._accept()
        return data

    def wait(self, for_s: float) -> None:
        """Wait for bytes, or at most so long [s]."""
        _wait_for([end for end in (self._listener, self._driver) if end is not None], for_s)

    def close(self) -> None:
        """Remove the port for good."""
        self.pull_out()

    def _accept(self) -> None:
        if self._listener is None:
            return
        with contextlib.suppress(BlockingIOError, ConnectionError):
            driver, _ = self._listener.accept()
            if self._driver is not None:
                driver.close()
                return
            driver.setblocking(False)
            driver.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._driver = driver

    def _disconnect(self) -> None:
        if self._driver is not None:
            self._driver.close()
            self._driver = None


def _wait_for(ends: Sequence[int | socket.socket], for_s: float) -> None:
    """Wait until one of these can be read, or so long [s]."""
    for_s = max(0.0, for_s)
    if ends:
        select.select(ends, [], [], for_s)
    else:  # on Windows there has to be one
        time.sleep(for_s)
