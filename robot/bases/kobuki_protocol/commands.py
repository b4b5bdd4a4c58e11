"""Commands to a Kobuki (docs/reference/kobuki.md#commands)."""

from __future__ import annotations

from enum import IntEnum, IntFlag
from struct import Struct
from typing import NamedTuple, Self

from robot.bases.kobuki_protocol.frames import frame, split, sub_payload, unpack


class Extra(IntFlag):
    """Flags of ``RequestExtra``: the parts that it requests."""

    HARDWARE = 0x01
    FIRMWARE = 0x02
    UDID = 0x08


class Output(IntFlag):
    """Bits of ``GpOutput``, which is always written whole (docs/reference/kobuki.md#commands).

    POWER is every external rail. A word without it cuts the power of whatever hangs on them, the
    robot's own computer included.
    """

    POWER = 0x00F0
    LED1_RED = 0x0100
    LED1_GREEN = 0x0200
    LED1_ORANGE = 0x0300
    LED2_RED = 0x0400
    LED2_GREEN = 0x0800
    LED2_ORANGE = 0x0C00


class MelodyCode(IntEnum):
    """What ``SoundSequence`` can play."""

    ON = 0
    OFF = 1
    RECHARGE = 2
    BUTTON = 3
    ERROR = 4
    CLEANING_START = 5
    CLEANING_END = 6


class BaseControl(NamedTuple):
    """The setpoint, until the next one: ``wheels.twist_to_control`` makes it from a twist."""

    speed_mm_s: int  # of the outer wheel
    radius_mm: int  # above 0: around a point on the left; 1: on the spot; 0: straight


class Sound(NamedTuple):
    """One note: ``note`` is 1 / (frequency [Hz] × 2.75e-6 s)."""

    note: int
    duration_ms: int

    @classmethod
    def at(cls, frequency_hz: float, duration_s: float) -> Self:
        """Return the nearest note, by the unit of frequency in docs/reference/kobuki.md#commands.

        Parameters
        ----------
        frequency_hz
            From 6 Hz: slower ones do not fit into two bytes.
        duration_s
            Up to 0.255 s, which is what one byte of milliseconds holds.
        """
        return cls(round(1 / (frequency_hz * 2.75e-6)), round(duration_s * 1000))


class SoundSequence(NamedTuple):
    """One of the melodies of the base."""

    melody: int


class RequestExtra(NamedTuple):
    """Asks for versions and the unique id, once."""

    flags: int


class GpOutput(NamedTuple):
    """All outputs, power rails and LEDs in one word: see ``Output``."""

    word: int


class SetGain(NamedTuple):
    """Sets the wheels' controller: type 0 factory, 1 user; gains × 1000; firmware from 1.2.0."""

    kind: int
    p: int
    i: int
    d: int


class GetGain(NamedTuple):
    """Asks for the controller's gains, once."""

    unused: int = 0


Command = BaseControl | Sound | SoundSequence | RequestExtra | GpOutput | SetGain | GetGain

COMMANDS: dict[int, tuple[type[Command], Struct]] = {
    1: (BaseControl, Struct("<hh")),
    3: (Sound, Struct("<HB")),
    4: (SoundSequence, Struct("<B")),
    9: (RequestExtra, Struct("<H")),
    12: (GpOutput, Struct("<H")),
    13: (SetGain, Struct("<BIII")),
    14: (GetGain, Struct("<B")),
}
_COMMAND_IDS = {kind: number for number, (kind, _) in COMMANDS.items()}


def encode_commands(*commands: Command) -> bytes:
    """Return one frame with these commands. Raises struct.error for numbers that do not fit."""
    payload = b""
    for command in commands:
        number = _COMMAND_IDS[type(command)]
        payload += sub_payload(number, COMMANDS[number][1].pack(*command))
    return frame(payload)


def decode_commands(payload: bytes) -> list[Command]:
    """Return the commands of a payload in their order, without unknown ones.

    Raises
    ------
    Malformed
        For sub-payloads that do not fill the payload, or of another length than
        docs/reference/kobuki.md#commands.
    """
    commands: list[Command] = []
    for number, data in split(payload):
        if number in COMMANDS:
            kind, layout = COMMANDS[number]
            commands.append(kind(*unpack(layout, number, data)))
    return commands
