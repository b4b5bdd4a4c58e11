"""What can go wrong with a base and with the line to it."""

from __future__ import annotations

import random
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from robot.bases.drive_train import (
    DEAD_TIME_S,
    DRIFT_DEG_MIN,
    GYRO_NOISE_DEG_S,
    LAG_S,
    STICTION_M_S,
)
from robot.wire.frames import to_number

T = TypeVar("T", int, float)


class BadFault(ValueError):
    """A fault that does not exist, or a value outside its limits."""


def _fault(default: T, least: float, most: float) -> T:
    bounded: T = field(default=default, metadata={"bounds": (least, most)})
    return bounded


@dataclass
class Faults:
    """Faults that hold now; each may be changed while the twin runs. At first it is ordinary: late,
    gradual, and with a gyro that drifts.

    Parameters
    ----------
    bumper, cliff, wheel_drop, over_current, buttons
        Bits that are set whatever the body touches, as in ``CoreSensors``.
    charger
        As in ``CoreSensors``.
    battery_v
        Voltage of the battery [V]; 16.7 is full (docs/reference/kobuki.md#feedback).
    left_scale, right_scale
        Size of the wheels over what the firmware assumes: 1.02 rolls 2 % too far, either way.
    drift_deg_min, gyro_noise_deg_s
        How far the gyro turns by itself [°/min], and the noise of its rate [°/s].
    dead_time_s, lag_s, stiction_m_s
        From an order to the first motion [s]; time constant of the motors [s]; a wheel that stands
        is not moved by an order below this [m/s].
    held
        Share of its speed that something takes from it, 0 to 1: 1 is a foot in its way.
    drop, flip, duplicate
        Probabilities that a byte of either direction is lost, has a bit flipped, or comes twice.
    false_header
        Probability that AA 55 comes before a frame.
    """

    bumper: int = _fault(0, 0, 7)
    cliff: int = _fault(0, 0, 7)
    wheel_drop: int = _fault(0, 0, 3)
    over_current: int = _fault(0, 0, 3)
    buttons: int = _fault(0, 0, 7)
    charger: int = _fault(0, 0, 22)
    battery_v: float = _fault(16.7, 0, 25.5)
    left_scale: float = _fault(1.0, 0.5, 1.5)
    right_scale: float = _fault(1.0, 0.5, 1.5)
    drift_deg_min: float = _fault(DRIFT_DEG_MIN, -600, 600)
    gyro_noise_deg_s: float = _fault(GYRO_NOISE_DEG_S, 0, 10)
    dead_time_s: float = _fault(DEAD_TIME_S, 0, 1)
    lag_s: float = _fault(LAG_S, 0, 1)
    stiction_m_s: float = _fault(STICTION_M_S, 0, 0.1)
    held: float = _fault(0.0, 0, 1)
    drop: float = _fault(0.0, 0, 1)
    flip: float = _fault(0.0, 0, 1)
    duplicate: float = _fault(0.0, 0, 1)
    false_header: float = _fault(0.0, 0, 1)

    def change(self, name: str, value: Any) -> Any:
        """Set a fault, and return its value before. Raises BadFault.

        Parameters
        ----------
        name
            One of the faults.
        value
            Its new value, within its bounds of ``LIMITS``.
        """
        if name not in LIMITS:
            raise BadFault(f"{name} is no fault. There are: {', '.join(LIMITS)}.")
        least, most = LIMITS[name]
        if to_number(value, least, most) is None:
            raise BadFault(f"{name} is a number from {least:g} to {most:g}.")
        was = getattr(self, name)
        if isinstance(was, int) and value != int(value):
            raise BadFault(f"{name} is a whole number.")
        setattr(self, name, type(was)(value))
        return was

    def damage(self, data: bytes, chance: random.Random) -> bytes:
        """Return the bytes that arrive of those that were sent.

        Parameters
        ----------
        data
            What was sent.
        chance
            Where chance comes from.
        """
        if self.false_header and chance.random() < self.false_header:
            data = b"\xaa\x55" + data
        if not self.drop and not self.flip and not self.duplicate:
            return data
        arrived = bytearray()
        for byte in data:
            if chance.random() < self.drop:
                continue
            flipped = chance.random() < self.flip
            arrived.append(byte ^ (1 << chance.randrange(8)) if flipped else byte)
            if chance.random() < self.duplicate:
                arrived.append(arrived[-1])
        return bytes(arrived)


# Name: least and largest value.
LIMITS: dict[str, tuple[float, float]] = {
    fault.name: fault.metadata["bounds"] for fault in fields(Faults)
}
