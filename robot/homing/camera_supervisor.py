"""Looks through a camera, by the process that owns it, while somebody wants that."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
from collections import deque
from typing import IO, Self

from robot.homing.sighting import Sighting, read_sighting

ASKS_EVERY_S = 1.0
MAX_WAITING = 64  # sightings that nobody takes; the oldest are dropped
END_S = 2.0


class CameraEye:
    """One camera, closed until somebody looks. As a context manager its process ends.

    Parameters
    ----------
    camera
        As ``HomeView`` names it.
    """

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self._process: subprocess.Popen[bytes] | None = None
        self._waiting: deque[Sighting] = deque(maxlen=MAX_WAITING)
        self._asked_s: float | None = None

    def __enter__(self) -> Self:
        """Start its process; the camera stays closed."""
        self._start()
        return self

    def __exit__(self, *_: object) -> None:
        """End its process."""
        process, self._process = self._process, None
        if process is None or process.stdin is None:
            return
        process.stdin.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def watch(self, now_s: float) -> None:
        """Look, for the next seconds. A process that has died is started again."""
        if self._asked_s is not None and 0 <= now_s - self._asked_s < ASKS_EVERY_S:
            return
        self._asked_s = now_s
        if self._process is None or self._process.poll() is not None:
            self._start()
        if self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(OSError):  # it has just died
                self._process.stdin.write(b"\n")

    def take(self) -> list[Sighting]:
        """Return the sightings since the last call, oldest first."""
        taken: list[Sighting] = []
        while self._waiting:
            taken.append(self._waiting.popleft())
        return taken

    def _start(self) -> None:
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
        self._process = process = subprocess.Popen(
            [sys.executable, "-m", "robot.homing.camera_process", self._camera],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is for us
        )
        if process.stdout is not None:
            threading.Thread(target=self._read, args=(process.stdout,), daemon=True).start()

    def _read(self, lines: IO[bytes]) -> None:
        with lines:
            for line in lines:
                with contextlib.suppress(ValueError):
                    self._waiting.append(read_sighting(line.decode(errors="replace")))
