"""Feedback of a Kobuki as it is sent; properties are in SI (docs/reference/kobuki.md#feedback)."""

from __future__ import annotations

from enum import IntFlag
from struct import Struct
from typing import Any, NamedTuple

from robot.bases.kobuki_protocol.frames import Malformed, frame, split, sub_payload, unpack


class SensorSide(IntFlag):
    """Bits of ``bumper`` and ``cliff``."""

    RIGHT = 0x01
    CENTER = 0x02
    LEFT = 0x04


class Wheel(IntFlag):
    """Bits of ``wheel_drop``."""

    RIGHT = 0x01
    LEFT = 0x02


class Button(IntFlag):
    """Bits of ``buttons``."""

    B0 = 0x01
    B1 = 0x02
    B2 = 0x04


class CoreSensors(NamedTuple):
    """What every frame has."""

    time_ms: int  # wraps at 65536, as the encoders do
    bumper: int = 0  # SensorSide
    wheel_drop: int = 0  # Wheel
    cliff: int = 0  # SensorSide
    left_ticks: int = 0
    right_ticks: int = 0
    left_pwm: int = 0
    right_pwm: int = 0
    buttons: int = 0  # Button
    charger: int = 0  # 0 discharging; low nibble 2 full, 6 charging; 0x10 by adapter, else dock
    battery: int = 167  # tenths of a volt
    over_current: int = 0  # left 1, right 2

    @property
    def battery_v(self) -> float:
        """Voltage of the battery [V]."""
        return self.battery / 10

    @property
    def is_charging(self) -> bool:
        """Whether a charger is at it: adapter or dock, charging or full."""
        return self.charger & 0x0F != 0


class DockIr(NamedTuple):
    """What the receivers see of a dock."""

    right: int = 0
    center: int = 0
    left: int = 0


class Inertia(NamedTuple):
    """Heading and turning rate of the calibrated gyro [0.01°, 0.01°/s]; the heading wraps."""

    angle: int
    rate: int


class CliffRaw(NamedTuple):
    """The floor sensors' ADC, 0 to 4095."""

    right: int
    center: int
    left: int


class MotorCurrent(NamedTuple):
    """Currents of the wheels [10 mA]; one byte each, unlike in the protocol's table.

    Source: docs/reference/kobuki.md#feedback.
    """

    left: int
    right: int


class Version(NamedTuple):
    """Of hardware or firmware."""

    major: int
    minor: int
    patch: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"


class GyroRaw(NamedTuple):
    """Samples of the gyro, (x, y, z) each [0.00875°/s]; its x axis points to the robot's left."""

    frame_id: int
    samples: tuple[tuple[int, int, int], ...]


class GpInput(NamedTuple):
    """Digital inputs (bits 0 to 3) and four analog ones (12 bit)."""

    digital: int = 0
    analog0: int = 0
    analog1: int = 0
    analog2: int = 0
    analog3: int = 0


class Udid(NamedTuple):
    """The unique id of a base."""

    a: int
    b: int
    c: int


class ControllerInfo(NamedTuple):
    """The wheels' controller, as ``SetGain``; the defaults are the factory's."""

    kind: int = 0
    p: int = 100_000
    i: int = 100
    d: int = 2000


class Feedback(NamedTuple):
    """One frame of a base; None for parts that it does not have."""

    core: CoreSensors | None = None
    dock: DockIr | None = None
    inertia: Inertia | None = None
    cliff: CliffRaw | None = None
    current: MotorCurrent | None = None
    hardware: Version | None = None
    firmware: Version | None = None
    gyro: GyroRaw | None = None
    gp: GpInput | None = None
    udid: Udid | None = None
    controller: ControllerInfo | None = None


_LAYOUTS: dict[int, tuple[str, Any, Struct]] = {
    1: ("core", CoreSensors, Struct("<HBBBHHbbBBBB")),
    3: ("dock", DockIr, Struct("<BBB")),
    4: ("inertia", Inertia, Struct("<hh3x")),
    5: ("cliff", CliffRaw, Struct("<HHH")),
    6: ("current", MotorCurrent, Struct("<BB")),
    16: ("gp", GpInput, Struct("<HHHHH6x")),
    19: ("udid", Udid, Struct("<III")),
    21: ("controller", ControllerInfo, Struct("<BIII")),
}
_HARDWARE, _FIRMWARE, _GYRO = 10, 11, 13
_SAMPLE = Struct("<hhh")
# What firmware 1.0.0 reports as its version, in two bytes (docs/reference/kobuki.md#feedback).
FIRST_FIRMWARE = Version(1, 2, 3)
_NUMBERS = (1, 3, 4, 5, 6, _HARDWARE, _FIRMWARE, _GYRO, 16, 19, 21)  # of Feedback's fields


def encode_feedback(feedback: Feedback, *, short_versions: bool = False) -> bytes:
    """Return the frame of a feedback, its sub-payloads in the order of their ids.

    Parameters
    ----------
    feedback
        What to encode; parts that are None are left out.
    short_versions
        Encode versions in two bytes, as firmware before 1.1.2 does.
    """
    payload = b""
    part: Any
    for number, part in zip(_NUMBERS, feedback, strict=True):
        if part is None:
            continue
        if number == _GYRO:
            data = bytes((part.frame_id, 3 * len(part.samples)))
            data += b"".join(_SAMPLE.pack(*sample) for sample in part.samples)
        elif number in (_HARDWARE, _FIRMWARE):
            data = bytes((part.patch, part.minor, part.major, 0))
            if short_versions:
                data = _write_short(number, part).to_bytes(2, "little")
        else:
            data = _LAYOUTS[number][2].pack(*part)
        payload += sub_payload(number, data)
    return frame(payload)


def decode_feedback(payload: bytes) -> Feedback:
    """Return the feedback of a payload, without unknown sub-payloads.

    Raises
    ------
    Malformed
        For sub-payloads that do not fill the payload, or of another length than
        docs/reference/kobuki.md#feedback.
    """
    parts: dict[str, Any] = {}
    for number, data in split(payload):
        if number in _LAYOUTS:
            name, kind, layout = _LAYOUTS[number]
            parts[name] = kind(*unpack(layout, number, data))
        elif number == _GYRO:
            parts["gyro"] = _read_gyro(data)
        elif number == _HARDWARE:
            parts["hardware"] = _read_version(data)
        elif number == _FIRMWARE:
            version = _read_version(data)
            is_first = len(data) == 2 and version == FIRST_FIRMWARE
            parts["firmware"] = Version(1, 0, 0) if is_first else version
    return Feedback(**parts)


def _read_gyro(data: bytes) -> GyroRaw:
    if len(data) < 2 or data[1] % 3 or len(data) != 2 + 2 * data[1]:
        raise Malformed("Gyro samples come in threes, as many as announced.")
    return GyroRaw(data[0], tuple(_SAMPLE.iter_unpack(data[2:])))


def _write_short(number: int, version: Version) -> int:
    if number == _FIRMWARE and version == Version(1, 0, 0):
        version = FIRST_FIRMWARE
    return version.major * 100 + version.minor * 10 + version.patch


def _read_version(data: bytes) -> Version:
    """Read four bytes, or the old form in two: 104 is 1.0.4, and so is 10004."""
    if len(data) == 4:
        return Version(data[2], data[1], data[0])
    if len(data) != 2:
        raise Malformed(f"A version has 2 or 4 bytes, not {len(data)}.")
    number = int.from_bytes(data, "little")
    base = 100 if number >= 10_000 else 10
    return Version(number // base**2, number // base % base, number % base)
