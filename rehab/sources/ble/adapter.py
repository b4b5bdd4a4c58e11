"""What a kind of sensor sends, as samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

from rehab.sources.intake import Cell

AXES = ("ax", "ay", "az", "gx", "gy", "gz")  # acceleration [m/s²], rate of rotation [rad/s]
G_M_S2 = 9.80665

Row = Mapping[str, Cell]


class Adapter(ABC):
    """Reads the notifications of one connection to a sensor.

    Attributes
    ----------
    notifies
        The characteristic that samples come from.
    start
        What has to be written where before they come, if anything.
    warning
        What a person has to know of this kind, if anything.
    damaged
        How many notifications could not be read.
    """

    notifies: ClassVar[str]
    start: ClassVar[tuple[str, bytes] | None] = None
    warning: ClassVar[str] = ""

    def __init__(self) -> None:
        self.damaged = 0

    @abstractmethod
    def read(self, data: bytes, arrived_s: float) -> list[Row]:
        """Return the samples of a notification, with ``time_s`` by the sensor's own clock.

        ``arrived_s`` is our clock [s], for sensors that have none.
        """

    def ask_time(self, number: int) -> tuple[str, bytes] | None:
        """Return what asks the sensor for its time, and where; None where it cannot say."""
        return None

    def read_times(self) -> Sequence[tuple[int, float]]:
        """Return the answers since the last call: the number that asked, the time [s]."""
        return ()
