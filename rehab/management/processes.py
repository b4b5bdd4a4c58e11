"""Several servers on one host, as children of one command.

A server that ends is started again, and one whose event loop is silent is ended. SIGTERM ends all;
SIGHUP restarts them one after the other, each once the one before it is ready: sessions are handed
over, and none is paused.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType

from rehab.sessions.live.pulse import SILENT_S, notify

log = logging.getLogger(__name__)

LOOK_S = 0.25
PAUSE_S = 1.0  # before a server that failed is started again
READY_S = 60.0
STOP_S = 40.0  # more than a server takes (rehab/sessions/live/process.py)
ABORT_S = 0.5  # for the trace of what hangs


class Server:
    """One server: its process, and when its event loop was heard last.

    Parameters
    ----------
    command
        What starts it.
    address
        Where it reports that it is ready, and that its loop turns: sd_notify(3).
    """

    def __init__(self, command: Sequence[str], address: Path) -> None:
        self._command = list(command)
        self.name = self._command[-1]  # its port
        self._address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(address))
        self._socket.setblocking(False)
        self.process: subprocess.Popen[bytes]
        self._was_ready = False
        self.due_s = 0.0  # when it has to have been heard, by the monotonic clock
        self.ended_s: float | None = None

    def start(self, now_s: float) -> None:
        """Start it. Signals of the terminal reach this command alone, which passes them on."""
        self.listen(now_s)  # what the one before it has left
        environment = os.environ | {"PYTHONUNBUFFERED": "1", "NOTIFY_SOCKET": str(self._address)}
        self.process = subprocess.Popen(
            self._command, stdin=subprocess.DEVNULL, start_new_session=True, env=environment
        )
        self._was_ready, self.ended_s = False, None
        self.due_s = now_s + READY_S

    def is_ready(self) -> bool:
        """Return whether it has reported that it is ready."""
        return self._was_ready

    def has_ended(self) -> bool:
        """Return whether its process has ended."""
        return self.process.poll() is not None

    def listen(self, now_s: float) -> None:
        """Read what it has reported."""
        with suppress(BlockingIOError):
            while state := self._socket.recv(256):
                self._was_ready = self._was_ready or b"READY=1" in state
                self.due_s = now_s + SILENT_S

    def look(self, now_s: float) -> None:
        """End it where it hangs, start it again where it has ended."""
        self.listen(now_s)
        if not self.has_ended():
            if now_s > self.due_s:
                log.critical("Server %s hangs, and is ended.", self.name)
                self.end()
        elif self.ended_s is None:
            log.error("Server %s ended with %s.", self.name, self.process.returncode)
            self.ended_s = now_s
        elif now_s - self.ended_s > PAUSE_S:
            self.start(now_s)

    def end(self) -> None:
        """End it at once; its trace, where it can still write one, says what hung."""
        with suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGABRT)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(ABORT_S)
        self.process.kill()
        self.process.wait()

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


class Processes:
    """Servers that are kept running until a signal.

    ``folder``: where they report; nobody else may write there.
    """

    def __init__(self, commands: Sequence[Sequence[str]], folder: Path) -> None:
        self._servers = [
            Server(command, folder / str(place)) for place, command in enumerate(commands, start=1)
        ]
        self._signals: list[int] = []
        self._wake = threading.Event()
        self._looked_s = 0.0

    def run(self) -> None:
        """Run the servers until SIGTERM or SIGINT."""
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._note)
        for server in self._servers:
            server.start(time.monotonic())
        is_announced = False
        while not self._is_ending:
            if signal.SIGHUP in self._signals:
                self._signals.remove(signal.SIGHUP)
                self._restart_each()
            self._look(self._servers)
            if not is_announced and any(server.is_ready() for server in self._servers):
                notify("READY=1")
                is_announced = True
            self._wake.wait(LOOK_S)
            self._wake.clear()
        notify("STOPPING=1")
        for server in self._servers:
            self._stop(server)
        for server in self._servers:
            with suppress(subprocess.TimeoutExpired):
                server.process.wait(STOP_S)
            server.end()
            server.close()

    @property
    def _is_ending(self) -> bool:
        return signal.SIGTERM in self._signals or signal.SIGINT in self._signals

    def _note(self, number: int, _: FrameType | None) -> None:
        self._signals.append(number)
        self._wake.set()

    def _look(self, watched: Sequence[Server]) -> None:
        """End servers that hang, start again those that have ended."""
        notify("WATCHDOG=1")
        now_s = time.monotonic()
        # After the whole machine stood still nobody was silent for longer than this command.
        stood_s = max(now_s - self._looked_s - 2 * LOOK_S, 0) if self._looked_s else 0.0
        self._looked_s = now_s
        for server in watched:
            server.due_s += stood_s
            server.look(now_s)

    def _restart_each(self) -> None:
        for server in self._servers:
            others = [one for one in self._servers if one is not server]
            self._stop(server)
            self._wait_until(server.has_ended, STOP_S, others)
            if self._is_ending:
                return
            server.end()
            server.start(time.monotonic())
            if not self._wait_until(server.is_ready, READY_S, self._servers):
                log.error("Server %s is not ready; the others go on as they are.", server.name)
                return

    @staticmethod
    def _stop(server: Server) -> None:
        with suppress(ProcessLookupError):
            server.process.terminate()

    def _wait_until(
        self, is_done: Callable[[], bool], within_s: float, watched: Sequence[Server]
    ) -> bool:
        """Return whether it was done within a time, looking after servers meanwhile."""
        until_s = time.monotonic() + within_s
        while not is_done():
            if time.monotonic() > until_s or self._is_ending:
                return False
            self._look(watched)
            time.sleep(LOOK_S)
        return True
