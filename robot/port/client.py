"""The client of ``robot.port``: starts that process, sends it orders, reads it and supervises it.

Each supervises the other: the process stops the base when our orders stop coming; when it dies, or
its reports stop coming, we stop the base ourselves, and start a new process.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from robot.motion.limits import ORDER_HOLDS_S
from robot.port.opening import PortOpener, send_stops

PACKAGES = Path(__file__).parents[2]
OWNER_SILENT_S = 0.3  # it reports every 0.1 s
START_S = 3.0  # a slow computer starts Python
END_S = 1.0
MAY_MOVE = " The base may be moving: switch it off at its side."
MAX_DEATHS = 5  # in a row without a report from any: it cannot be run here


@dataclass(frozen=True, slots=True)
class ReceivedBytes:
    """Bytes received at a port: when [s], after which opening of it, and the data."""

    at_s: float
    opened: int
    data: bytes


class PortClient:
    """A serial port in a process of its own.

    Parameters
    ----------
    url
        /dev/kobuki, COM3, a pty, or socket://host:port; empty for a Kobuki, now or later.
    baud
        Speed of the line [bit/s].
    stop
        The frame that stops the base.
    on_data
        Called with the received bytes, on a thread of its own.
    monotonic
        The computer's clock [s], which the process shares.

    Attributes
    ----------
    problem
        Why the port is not open; empty where it is.
    counters
        How often something went wrong, with this process and the ones before it.
    is_dead
        Whether no process can be kept alive.
    """

    def __init__(
        self,
        url: str,
        baud: int,
        stop: bytes,
        on_data: Callable[[ReceivedBytes], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._command = [sys.executable, "-m", "robot.port", url]
        self._command += ["--baud", str(baud), "--stop", stop.hex()]
        self._open_port, self._stop_frame = PortOpener(url, baud), stop
        self._on_data = on_data
        self._monotonic = monotonic
        self.problem = "The port has not been opened yet."
        self.counters: Counter[str] = Counter(restarts=0, junk=0)
        self.is_dead = False
        self._owes_stop = False
        self._number = 0
        self._openings = self._openings_before = 0
        self._counted: Counter[str] = Counter()  # by the present process
        self._last_report_s = self._ordered_s = monotonic()
        self._has_reported, self._deaths = False, 0
        self._closing = threading.Event()
        self._process = self._start()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def order(self, frame: bytes, once: bytes = b"") -> None:
        """Order this frame in place of the last one; ``once`` is sent one time before it.

        Parameters
        ----------
        frame
            Commands for the wheels, of up to 64 bytes.
        once
            Other commands, of up to 64 bytes.
        """
        now_s = self._monotonic()
        if now_s - self._ordered_s > ORDER_HOLDS_S:
            self._last_report_s = now_s  # we hung, not the process
        self._ordered_s = now_s
        if now_s - self._last_report_s > (OWNER_SILENT_S if self._has_reported else START_S):
            self._last_report_s = now_s
            self._process.kill()  # it hangs; the next one begins with stops
            return
        self._number += 1
        order = {"number": self._number, "sent_s": now_s, "frame": frame.hex(), "once": once.hex()}
        pipe = self._process.stdin
        with contextlib.suppress(OSError, ValueError):  # it has just died; a new one will come
            if pipe is not None:
                pipe.write(json.dumps(order).encode() + b"\n")

    def close(self) -> None:
        """Stop the base, and end the process. Never raises.

        Where the port was lost while the base moved, the process outlives us, and stops the base
        when it is back.
        """
        self._closing.set()
        process = self._process
        with contextlib.suppress(OSError):
            if process.stdin is not None:
                process.stdin.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            if self._owes_stop and self._monotonic() - self._last_report_s < END_S:
                process.returncode = 0  # so that nobody complains that it still runs
                return
            process.kill()
            process.wait(END_S)
            send_stops(self._open_port, self._stop_frame)
            if self._owes_stop:
                heir = self._start()
                heir.returncode = 0
                for pipe in (heir.stdin, heir.stdout):
                    if pipe is not None:
                        pipe.close()
        self._thread.join(END_S)

    def _start(self) -> subprocess.Popen[bytes]:
        paths = [str(PACKAGES), *filter(None, [os.environ.get("PYTHONPATH")])]
        return subprocess.Popen(
            self._command + ["--owes-stop"] * self._owes_stop,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # no key of a terminal reaches it
        )

    def _listen(self) -> None:
        """Read from one process after the other until closed or failed."""
        try:
            self._supervise()
        finally:
            self.is_dead = not self._closing.is_set()

    def _supervise(self) -> None:
        while True:
            self._read_process(self._process)
            if self._closing.is_set():
                return
            send_stops(self._open_port, self._stop_frame)  # before a new process has started
            self._deaths = 0 if self._has_reported else self._deaths + 1
            if self._deaths >= MAX_DEATHS:
                return
            self.counters["restarts"] += 1
            self.counters.update(self._counted)
            self._counted = Counter()
            self._openings_before = self._openings
            self._last_report_s, self._has_reported = self._monotonic(), False
            self.problem = "The process that owns the port died, and is restarted."
            self._process = self._start()
            if self._closing.is_set():  # closed meanwhile: nobody else knows of this one
                self._process.kill()
                self._process.wait(END_S)
                return

    def _read_process(self, process: subprocess.Popen[bytes]) -> None:
        if process.stdout is None or process.stdin is None:
            return
        with process.stdout, contextlib.suppress(OSError, ValueError):
            rest = b""
            while data := process.stdout.read(65536):
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    self._handle_line(line)
        with contextlib.suppress(OSError):
            process.stdin.close()
        process.wait()

    def _handle_line(self, line: bytes) -> None:
        try:
            report = json.loads(line)
            received = ReceivedBytes(
                float(report["at_s"]), int(report["opened"]), bytes.fromhex(report["bytes"])
            )
            self._counted = Counter(report["counters"])
            self._owes_stop = bool(report["owes_stop"])
            self.problem = str(report["problem"]) + MAY_MOVE * self._owes_stop
        except (ValueError, TypeError, KeyError):
            self.counters["junk"] += 1
            return
        self._last_report_s, self._has_reported = self._monotonic(), True
        self._openings = self._openings_before + received.opened
        if received.data:
            self._on_data(ReceivedBytes(received.at_s, self._openings, received.data))

    def count(self) -> dict[str, int]:
        """Return all counters, those of the present process included."""
        total = Counter(self.counters)
        total.update(self._counted)
        return dict(total) | {"openings": self._openings}
