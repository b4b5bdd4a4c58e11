"""Cameras: what OpenCV opens, or a picture in a file that is replaced. Needs OpenCV."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

import cv2
import numpy as np

from robot.homing.detector import Picture

FILE = "file:"  # and the path of a picture, each new one in place of the last
WIDTH_PX, HEIGHT_PX = 640, 480  # asked for; what comes may have another size
FILE_EVERY_S = 0.01


class Camera:
    """Reads a camera on a thread of its own, so that no frame waits in its driver.

    Parameters
    ----------
    name
        As OpenCV names it: a number, a device, an address; or ``file:`` and a path.
    monotonic
        The clock [s].
    """

    def __init__(self, name: str, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._name, self._monotonic = name, monotonic
        self._newest: tuple[float, Picture] | None = None
        self._has_new, self._over = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        """Begin to read."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Close it. One that hangs in its driver is left to the end of the process."""
        self._over.set()
        self._thread.join(1.0)

    def read(self, within_s: float) -> tuple[float, Picture] | None:
        """Return when the newest frame came [s], and the frame; None where none came in time."""
        if not self._has_new.wait(within_s):
            return None
        self._has_new.clear()
        return self._newest

    @property
    def is_over(self) -> bool:
        """Whether it cannot be opened, or sends nothing any more."""
        return not self._thread.is_alive()

    def _run(self) -> None:
        if self._name.startswith(FILE):
            self._watch_file(Path(self._name.removeprefix(FILE)))
        else:
            self._read_device()

    def _read_device(self) -> None:
        device = cv2.VideoCapture(int(self._name) if self._name.isdigit() else self._name)
        try:
            device.set(cv2.CAP_PROP_FRAME_WIDTH, WIDTH_PX)
            device.set(cv2.CAP_PROP_FRAME_HEIGHT, HEIGHT_PX)
            while not self._over.is_set():
                has_come, frame = device.read()
                if not has_come:
                    return
                self._put(self._monotonic(), frame)
        finally:
            device.release()

    def _watch_file(self, path: Path) -> None:
        seen_ns = 0
        while not self._over.wait(FILE_EVERY_S):
            with contextlib.suppress(OSError):
                changed_ns = path.stat().st_mtime_ns
                if changed_ns == seen_ns:
                    continue
                frame = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
                age_s = max(0.0, time.time() - changed_ns / 1e9)
                seen_ns = changed_ns
                if frame is not None:
                    self._put(self._monotonic() - age_s, frame)

    def _put(self, at_s: float, frame: cv2.typing.MatLike) -> None:
        self._newest = at_s, cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY).astype(np.uint8)
        self._has_new.set()
