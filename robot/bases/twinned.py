"""The twin as a base: the driver of a real Kobuki, and a simulated one of its own to drive."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from robot.bases.base import BaseLost, GroundTruth
from robot.bases.kobuki import KobukiBase
from robot.motion.pose import Pose

END_S = 2.0


class TwinBase(KobukiBase):
    """Starts a twin, drives it over its port, and ends it when closed."""

    name: ClassVar[str] = "twin"
    abilities = replace(KobukiBase.abilities, simulated=True)

    def __init__(self, monotonic: Callable[[], float], *options: str) -> None:
        super().__init__(monotonic)
        self._options = options
        self._twin: subprocess.Popen[str] | None = None
        self._order_lock = threading.Lock()

    def open(self) -> None:
        """Start the twin, and open its port. Raises BaseLost where it does not start."""
        self._twin = subprocess.Popen(
            [sys.executable, "-m", "robot.bases.twin", "--child", *self._options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for us: the twin lives until we have stopped it
        )
        self.port = "" if self._twin.stdout is None else self._twin.stdout.readline().strip()
        if not self.port:
            self._end()
            raise BaseLost("The twin does not start: see its messages above.")
        try:
            super().open()
        except BaseException:
            self._end()
            raise

    def close(self) -> None:
        """Close its port, and end it."""
        try:
            super().close()
        finally:
            self._end()

    def set_home(self) -> None:
        """Carry it back to where it began."""
        self.stop()
        self.send_order({"do": "carry_home"})
        super().set_home()

    def ground_truth(self) -> GroundTruth:
        """Return its true pose, and the largest distance from home since the last call."""
        seen = self.send_order({"do": "look"})
        return GroundTruth(Pose(**seen["pose"]), seen["farthest_m"])

    def send_order(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Send an order to the twin, and return its answer. Raises BaseLost and ValueError."""
        twin = self._twin
        if twin is None or twin.stdin is None or twin.stdout is None:
            raise BaseLost("The twin has not been started.")
        with self._order_lock:
            try:
                twin.stdin.write(json.dumps(order) + "\n")
                twin.stdin.flush()
                answer: dict[str, Any] = json.loads(twin.stdout.readline())
            except (OSError, ValueError):
                raise BaseLost("The twin does not answer any more.") from None
        if "error" in answer:
            raise ValueError(answer["error"])
        return answer

    def _end(self) -> None:
        if self._twin is None:
            return
        if self._twin.stdin is not None:
            self._twin.stdin.close()
        try:
            self._twin.wait(END_S)
        except subprocess.TimeoutExpired:
            self._twin.kill()
            self._twin.wait()
        if self._twin.stdout is not None:
            self._twin.stdout.close()
