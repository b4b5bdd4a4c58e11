"""WitMotion WT901BLE, WT9011DCL and alike, by WitMotion's Bluetooth 5.0 communication protocol.

A frame has 20 bytes, little-endian: 0x55, 0x61, then acceleration (16 g), rate of rotation (2000
°/s) and angles, 3 × int16 each, of which 32768 is the whole range.
"""

from __future__ import annotations

import math
import struct

from rehab.sources.ble.adapter import AXES, G_M_S2, Adapter, Row

FLAG = b"\x55\x61"
FRAME = 20
_NUMBERS = struct.Struct("<6h")
_SCALES = (16 * G_M_S2 / 32768,) * 3 + (math.radians(2000) / 32768,) * 3


class WitMotion(Adapter):
    """It neither counts nor stamps its samples, so that their times are those of arrival."""

    notifies = "0000ffe4-0000-1000-8000-00805f9a34fb"
    start = (
        "0000ffe9-0000-1000-8000-00805f9a34fb",
        bytes((0xFF, 0xAA, 0x03, 0x09, 0x00)),
    )  # 100 Hz
    warning = (
        "A WitMotion sensor does not count its samples: lost ones cannot be noticed, and times are "
        "estimated. Steps of two such sensors are not compared."
    )

    def __init__(self) -> None:
        super().__init__()
        self._rest = b""

    def read(self, data: bytes, arrived_s: float) -> list[Row]:
        """Return the samples of whole frames; a notification may hold several, or half a one."""
        self._rest += data
        rows: list[Row] = []
        while len(self._rest) >= FRAME:
            begin = self._rest.find(FLAG)
            if begin:
                self.damaged += 1
                self._rest = self._rest[begin:] if begin > 0 else self._rest[-1:]
                continue
            numbers = _NUMBERS.unpack_from(self._rest, len(FLAG))
            self._rest = self._rest[FRAME:]
            values = (one * scale for one, scale in zip(numbers, _SCALES, strict=True))
            rows.append({"time_s": arrived_s, **dict(zip(AXES, values, strict=True))})
        return rows
