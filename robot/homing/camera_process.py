"""`python -m robot.homing.camera_process CAMERA`: the process that owns a camera.

Each line on standard input has it look for some seconds more; standard output has a line for each
frame (``Sighting``). Otherwise the camera is closed. No picture leaves this process. It ends when
standard input closes. A camera or driver that hangs or breaks holds up nothing but this.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable

from robot.homing.camera import Camera
from robot.homing.codes import CAMERA_DARK, NO_CAMERA
from robot.homing.detector import find_tags, is_dark, make_detector
from robot.homing.sighting import Sighting

LOOKS_S = 3.0  # after the last line
WAITS_S = 0.5  # for a frame, before it looks whether anybody still wants one
RETRY_S = 1.0  # between two openings of a camera that is not there


class Demand:
    """Until when a camera is wanted, by the lines that come in."""

    def __init__(self) -> None:
        self.is_over = False
        self._until_s = float("-inf")
        self._came = threading.Event()

    def read(self, descriptor: int) -> None:
        """Read lines until the input closes."""
        while os.read(descriptor, 4096):
            self._until_s = time.monotonic() + LOOKS_S
            self._came.set()
        self.is_over = True
        self._came.set()

    @property
    def is_open(self) -> bool:
        """Whether somebody wants to look now."""
        return not self.is_over and time.monotonic() < self._until_s

    def wait(self) -> None:
        """Wait until somebody wants to look, or nobody ever will."""
        if not self.is_over:
            self._came.wait()
            self._came.clear()


def look(name: str, wants: Callable[[], bool], tell: Callable[[Sighting], None]) -> None:
    """Tell what a camera sees in each frame, for as long as somebody wants that."""
    detector = make_detector()
    with Camera(name) as camera:
        while wants():
            frame = camera.read(WAITS_S)
            if frame is None:
                if camera.is_over:
                    tell(Sighting(time.monotonic(), problem=NO_CAMERA))
                    time.sleep(RETRY_S)
                    return
                continue
            at_s, picture = frame
            size_px = picture.shape[1], picture.shape[0]
            if is_dark(picture):
                tell(Sighting(at_s, (), size_px, CAMERA_DARK))
            else:
                tell(Sighting(at_s, tuple(find_tags(detector, picture)), size_px))


def main(name: str) -> None:
    """Look whenever it is wanted, until standard input closes."""
    if hasattr(os, "nice"):
        os.nice(5)  # the base comes first
    demand = Demand()
    threading.Thread(target=demand.read, args=(0,), daemon=True).start()

    def tell(sighting: Sighting) -> None:
        os.write(1, sighting.to_line().encode() + b"\n")

    while not demand.is_over:
        demand.wait()
        while demand.is_open:
            try:
                look(name, lambda: demand.is_open, tell)
            except BrokenPipeError:
                return


if __name__ == "__main__":
    main(sys.argv[1])
