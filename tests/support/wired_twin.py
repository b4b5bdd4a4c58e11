"""A Kobuki's driver and its twin with no port between them, on a clock that a test moves."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any, ClassVar

from robot.bases import Abilities, BaseState
from robot.bases.kobuki import KobukiBase
from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.twin.__main__ import make_body
from robot.bases.twin.faults import Faults
from robot.bases.twin.firmware import Firmware
from robot.bases.twin.process import Twin
from robot.port.client import ReceivedBytes
from tests.support.twin_bench import Wire

GREETS_S = 1.0


class NoPort:
    """Passes orders to the twin at once."""

    is_dead, problem = False, ""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def order(self, frame: bytes, extra: bytes = b"") -> None:
        self._wire.coming += extra + frame

    def count(self) -> dict[str, int]:
        return {}


class WiredTwin(KobukiBase):
    """As ``TwinBase``, but for the port and the clock; with physics where they are installed."""

    name: ClassVar[str] = "twin"
    abilities = Abilities(simulated=True, moves=True, announces=True, notes=True, bumpers=True)

    def __init__(self, monotonic: Callable[[], float], body: str = "auto") -> None:
        super().__init__(monotonic)
        self._wire = Wire()
        chance = random.Random(5)
        firmware = Firmware(make_body(body, lambda _notice: None), Faults(), chance=chance)
        self._twin = Twin(firmware, self._wire)
        self._client: Any = NoPort(self._wire)
        self._lived_s = monotonic() - GREETS_S
        self._monotonic = lambda: self._lived_s + FRAME_S
        while self._lived_s < monotonic() - FRAME_S:
            self.stop()  # which asks for its firmware's version until it is known
            self.read()
        self._monotonic = monotonic

    def read(self) -> BaseState:
        now_s = self._monotonic()
        while self._lived_s + FRAME_S <= now_s:
            self._lived_s += FRAME_S
            self._twin.step(self._lived_s)
            sent, self._wire.sent = self._wire.sent, b""
            self._receive(ReceivedBytes(self._lived_s, 1, sent))
        return super().read()

    def set_home(self) -> None:
        self.stop()
        self.do("carry_home")
        super().set_home()

    def do(self, what: str, **more: Any) -> None:
        """Do something to the twin."""
        self._twin.execute({"do": what, **more}, self._monotonic())
