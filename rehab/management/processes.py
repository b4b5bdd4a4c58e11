"""Several servers on one host, as children of one command.

A server that ends is started again. SIGTERM ends all; SIGHUP restarts them one after the other,
each once the one before it is ready: sessions are handed over, and none is paused.
"""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from types import FrameType

log = logging.getLogger(__name__)

PAUSE_S = 1.0  # before a server that failed is started again
READY_S = 60.0
STOP_S = 40.0  # more than a server takes (rehab/sessions/live/process.py)


class Processes:
    """Servers that are kept running until a signal."""

    def __init__(self, commands: Sequence[Sequence[str]]) -> None:
        self._commands = commands
        self._servers: list[subprocess.Popen[str]] = []
        self._ready = [threading.Event() for _ in commands]
        self._signals: list[int] = []
        self._wake = threading.Event()

    def run(self) -> None:
        """Run the servers until SIGTERM or SIGINT."""
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._note)
        self._servers = [self._start(place) for place in range(len(self._commands))]
        while signal.SIGTERM not in self._signals and signal.SIGINT not in self._signals:
            if signal.SIGHUP in self._signals:
                self._signals.remove(signal.SIGHUP)
                self._restart_each()
            self._revive()
            self._wake.wait(PAUSE_S)
            self._wake.clear()
        self._stop(self._servers)

    def _note(self, number: int, _: FrameType | None) -> None:
        self._signals.append(number)
        self._wake.set()

    def _start(self, place: int) -> subprocess.Popen[str]:
        # Signals of the terminal reach this command alone, which passes them on.
        server = subprocess.Popen(
            list(self._commands[place]),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        self._ready[place].clear()
        threading.Thread(target=self._read, args=(place, server), daemon=True).start()
        return server

    def _read(self, place: int, server: subprocess.Popen[str]) -> None:
        """Pass on what a server says."""
        for line in server.stdout or ():
            if line.startswith("Ready"):
                self._ready[place].set()
            sys.stdout.write(f"[{place + 1}] {line}")
            sys.stdout.flush()

    def _revive(self) -> None:
        for place, server in enumerate(self._servers):
            if server.poll() is not None:
                log.error("Server %s ended with %s and starts again.", place + 1, server.returncode)
                self._servers[place] = self._start(place)

    def _restart_each(self) -> None:
        for place, server in enumerate(self._servers):
            self._stop([server])
            self._servers[place] = self._start(place)
            if not self._ready[place].wait(READY_S):
                log.error("Server %s is not ready; the others go on as they are.", place + 1)
                return

    @staticmethod
    def _stop(servers: Sequence[subprocess.Popen[str]]) -> None:
        for server in servers:
            with suppress(ProcessLookupError):
                server.terminate()
        for server in servers:
            try:
                server.wait(STOP_S)
            except subprocess.TimeoutExpired:
                server.kill()
                server.wait()
