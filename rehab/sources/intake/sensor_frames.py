"""Frames of sensors that GARRY's sketches run on (docs/garry_sensor): names, samples, times."""

from __future__ import annotations

import re
from collections.abc import Mapping

from rehab.sources.intake.rows import BadRow, Cell

WRAP_US = 2**32
MAX_FRAME = 1024  # bytes
_FRAME = re.compile(rb"\$([HDT]),([^*$]*)\*([0-9A-Fa-f]{2})\s*")


class SensorFrameReader:
    """Reads frames from bytes that may begin, break off and be damaged anywhere."""

    def __init__(self) -> None:
        self.damaged = 0
        self.times: list[tuple[int, float]] = []  # answers to questions for the sensor's time
        self._partial = b""
        self._names: list[str] = []
        self._last_us: int | None = None

    def read(self, data: bytes) -> list[Mapping[str, Cell]]:
        """Return the rows of all frames that these bytes complete.

        Damaged frames are counted and skipped: their samples are missing, and strides that need
        them have a reason. Frames before the first names are skipped silently.
        """
        *lines, self._partial = (self._partial + data).split(b"\n")
        if len(self._partial) > MAX_FRAME:
            self._partial = b""
            self.damaged += 1
        rows = []
        for line in lines:
            try:
                row = self._read_frame(line)
            except BadRow:
                self.damaged += 1
            else:
                if row is not None:
                    rows.append(row)
        return rows

    def _read_frame(self, line: bytes) -> Mapping[str, Cell] | None:
        frame = _FRAME.fullmatch(line)
        if frame is None or compute_checksum(line[1 : frame.start(3) - 1]) != int(frame[3], 16):
            raise BadRow("damaged")
        cells = frame[2].decode("ascii", "replace").split(",")
        if frame[1] == b"H":
            self._names = cells
            return None
        if frame[1] == b"T" and len(cells) == 2 and all(one.isdecimal() for one in cells):
            # Only samples move the count: an answer may overtake them.
            self.times.append((int(cells[0]), unwrap_us(int(cells[1]), self._last_us) / 1e6))
            return None
        if not self._names:
            return None
        if len(cells) != len(self._names) + 1 or not cells[0].isdecimal():
            raise BadRow("cells")
        try:
            numbers = [float(cell) if cell else None for cell in cells[1:]]
        except ValueError:
            raise BadRow("numbers") from None
        self._last_us = unwrap_us(int(cells[0]), self._last_us)
        return {"time_s": self._last_us / 1e6} | dict(zip(self._names, numbers, strict=True))


def unwrap_us(counted_us: int, last_us: int | None) -> int:
    """Return microseconds that go on where a counter of 32 bits wraps around, next to the last."""
    counted_us %= WRAP_US
    if last_us is None:
        return counted_us
    ahead_us = (counted_us - last_us) % WRAP_US
    return last_us + (ahead_us - WRAP_US if ahead_us > WRAP_US // 2 else ahead_us)


def compute_checksum(data: bytes) -> int:
    """Return the exclusive or of all bytes."""
    result = 0
    for byte in data:
        result ^= byte
    return result
