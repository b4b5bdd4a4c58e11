"""Heart-rate belts and watches: Bluetooth SIG, Heart Rate Service 1.0, Measurement (0x2A37)."""

from __future__ import annotations

from rehab.sources.ble.adapter import Adapter, Row
from rehab.training.steps import HEART_RATE

_IS_WIDE, _NO_CONTACT, _CONTACT_BITS = 1 << 0, 0b100, 0b110


class HeartRate(Adapter):
    """A rate about once a second; without skin contact a sensor that notices says none."""

    notifies = "00002a37-0000-1000-8000-00805f9b34fb"

    def read(self, data: bytes, arrived_s: float) -> list[Row]:
        """Return the rate [1/min]; what follows it (energy, beats apart) is not read."""
        size = 2 if data and data[0] & _IS_WIDE else 1
        rate = data[1 : 1 + size]
        if len(rate) < size:
            self.damaged += 1
            return []
        beats = int.from_bytes(rate, "little")
        if data[0] & _CONTACT_BITS == _NO_CONTACT or not beats:
            return []
        return [{HEART_RATE: float(beats)}]
