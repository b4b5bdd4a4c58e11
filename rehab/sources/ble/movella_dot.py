"""Movella DOT (Xsens DOT), by its BLE Services Specification, revision C (2023), tables 7 to 17.

Payload mode 21 "rate quantities", little-endian: microseconds (uint32), acceleration (3 × float32,
m/s²), rate of rotation (3 × float32, °/s). At most 60 samples a second come live.
"""

from __future__ import annotations

import math
import struct

from rehab.sources.ble.adapter import AXES, Adapter, Row
from rehab.sources.intake.sensor_frames import unwrap_us

_SAMPLE = struct.Struct("<I6f")
_DEGREE = math.pi / 180


class MovellaDot(Adapter):
    """It stamps samples itself and does not count them: what is lost shows in its stamps."""

    notifies = "15172003-4947-11e9-8646-d663bd873d93"
    start = ("15172001-4947-11e9-8646-d663bd873d93", bytes((1, 1, 21)))  # measure, start, mode

    def __init__(self) -> None:
        super().__init__()
        self._last_us: int | None = None

    def read(self, data: bytes, arrived_s: float) -> list[Row]:
        """Return the sample of a notification; one that comes twice is left out."""
        if len(data) != _SAMPLE.size:
            self.damaged += 1
            return []
        stamp_us, *numbers = _SAMPLE.unpack(data)
        now_us = unwrap_us(stamp_us, self._last_us)
        if now_us == self._last_us:
            return []
        self._last_us = now_us
        numbers[3:] = [one * _DEGREE for one in numbers[3:]]
        return [{"time_s": now_us / 1e6, **dict(zip(AXES, numbers, strict=True))}]
