"""What devices beside the signals say: a treadmill's speed, a heart-rate sensor's beats.

They come as frames of Bluetooth, or as cells of a lab's rows.

FTMS: Bluetooth SIG, Fitness Machine Service 1.0, section 4.9, Treadmill Data (0x2ACD). Reading the
frames from the air is a source's matter; here are bytes and numbers alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from rehab.sources.intake.rows import BadRow, Cell
from rehab.training.steps import HEART_RATE

BELT_SPEED, WEIGHT_SUPPORT, INCLINE = "belt_speed_m_s", "weight_support_percent", "incline_percent"
# Cells of rows, in SI as D-Flow streams its belts; of two belts the mean counts.
CELLS = {
    BELT_SPEED: (BELT_SPEED, "LeftBelt.Speed", "RightBelt.Speed"),
    WEIGHT_SUPPORT: (WEIGHT_SUPPORT,),
    INCLINE: (INCLINE,),
    HEART_RATE: (HEART_RATE,),
}
NAMES = frozenset(name for names in CELLS.values() for name in names)

_NO_SPEED, _AVERAGE_SPEED, _DISTANCE, _INCLINE = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_SPEED_M_S = 0.01 / 3.6  # a unit is 0.01 km/h
_NO_INCLINE = 0x7FFF


def decode_treadmill(frame: bytes) -> dict[str, float]:
    """Return what a Treadmill Data frame says, by the names of a stride's further values.

    Parameters
    ----------
    frame
        Flags (uint16), then the fields that they announce, little-endian. Bit 0 is inverted: the
        speed is there where it is 0. Fields behind the incline are not read.

    Returns
    -------
    dict
        ``belt_speed_m_s`` [m/s] and ``incline_percent`` [%], as far as they are in the frame.

    Raises
    ------
    BadRow
        For a frame that is shorter than its flags say.
    """
    flags, place, said = _read(frame, 0, 2), 2, {}
    if not flags & _NO_SPEED:
        said[BELT_SPEED] = round(_read(frame, place, 2) * _SPEED_M_S, 4)
        place += 2
    place += 2 if flags & _AVERAGE_SPEED else 0
    place += 3 if flags & _DISTANCE else 0
    if flags & _INCLINE:
        tenths = _read(frame, place, 2, signed=True)
        if tenths != _NO_INCLINE:
            said[INCLINE] = tenths / 10
    return said


def encode_treadmill(speed_m_s: float) -> bytes:
    """Return the frame of a treadmill that says its speed [m/s] alone."""
    return b"\x00\x00" + round(speed_m_s / _SPEED_M_S).to_bytes(2, "little")


def read_devices(cells: Mapping[str, Cell]) -> dict[str, float]:
    """Return what a lab's row says of devices. What is blank or no number is left out."""
    said = {}
    for name, columns in CELLS.items():
        values = [cells.get(column) for column in columns]
        numbers = [one for one in values if isinstance(one, float) and math.isfinite(one)]
        if numbers:
            said[name] = math.fsum(numbers) / len(numbers)
    return said


def _read(frame: bytes, place: int, size: int, *, signed: bool = False) -> int:
    part = frame[place : place + size]
    if len(part) < size:
        raise BadRow(
            f"A treadmill's frame ends after {len(frame)} bytes, within a field that it announces. "
            "Pass each notification on whole."
        )
    return int.from_bytes(part, "little", signed=signed)
