"""Stops the base where the process that owns its port dies, even if its parent died with it."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import NoReturn

from robot.port.opening import send_stops
from robot.port.owner import RETRY_S, SerialPort

TRY_S = 5.0  # how long it tries: whoever has the port meanwhile has begun with stops
CANCELED = b"."


class OrphanStop:
    """A process beside this one that waits for its death. None where a system cannot fork.

    To be made before there are threads, and before the port is open.

    Parameters
    ----------
    open_port
        Opens the port; raises OSError or ValueError.
    stop
        The frame that stops the base.
    """

    def __init__(self, open_port: Callable[[], SerialPort], stop: bytes) -> None:
        self._pipe: int | None = None
        if not hasattr(os, "fork"):
            return
        waiting, self._pipe = os.pipe()
        if os.fork() == 0:
            os.close(self._pipe)
            _watch(waiting, open_port, stop)
        os.close(waiting)

    def cancel(self) -> None:
        """End that process: the base has been stopped."""
        if self._pipe is not None:
            os.write(self._pipe, CANCELED)
            os.close(self._pipe)
            self._pipe = None


def _watch(pipe: int, open_port: Callable[[], SerialPort], stop: bytes) -> NoReturn:
    """Wait for the end of a pipe; stop the base unless that was canceled before."""
    try:
        os.setsid()  # what ends the group of the others does not end it
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):  # who reads them waits for their end
            os.dup2(nowhere, stream)
        if os.read(pipe, 1) != CANCELED:
            until_s = time.monotonic() + TRY_S
            while not send_stops(open_port, stop) and time.monotonic() < until_s:
                time.sleep(RETRY_S)
    finally:
        os._exit(0)
