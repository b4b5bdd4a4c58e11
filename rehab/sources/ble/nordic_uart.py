"""GARRY's own lines over the Nordic UART service (docs/garry_sensor/garry_sensor_ble)."""

from __future__ import annotations

from collections.abc import Sequence

from rehab.sources.ble.adapter import Adapter, Row
from rehab.sources.intake.sensor_frames import SensorFrameReader


class NordicUart(Adapter):
    """The frames of `rehab.sources.serial_sensor`, cut anywhere, with a count of samples.

    ``T,7`` and a newline ask for the time; the sensor answers ``$T,7,1234567890*XX`` at once, in
    microseconds.
    """

    notifies = "6e400003-b5a3-f393-e0a9-e50e24dcca9e"
    _writes = "6e400002-b5a3-f393-e0a9-e50e24dcca9e"

    def __init__(self) -> None:
        super().__init__()
        self._frames = SensorFrameReader()

    def read(self, data: bytes, arrived_s: float) -> list[Row]:
        """Return the rows of the lines that this part completes."""
        rows = self._frames.read(data)
        self.damaged = self._frames.damaged
        return rows

    def ask_time(self, number: int) -> tuple[str, bytes]:
        """Return the line that asks for the time."""
        return self._writes, f"T,{number}\n".encode()

    def read_times(self) -> Sequence[tuple[int, float]]:
        """Return the answers that came."""
        answers, self._frames.times = self._frames.times, []
        return answers
