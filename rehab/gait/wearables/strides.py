"""A stride of a sensor on a foot or shank, and why one does not count."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

VERSION = 2  # of this algorithm, stored with each stride
STRIDE_MIN_S, STRIDE_MAX_S = 0.5, 6.0
TURN_RAD = math.radians(20)  # in a stride; 99.5 % of straight ones turn by less than 19°
SLOW_S = 1 / 45  # between samples; contacts are known to 50 Hz
LOST_S = 0.04  # without a sample beside a contact


class Place(StrEnum):
    """Where a sensor is worn."""

    FOOT = "foot"
    SHANK = "shank"


# What is added to the times of zero crossings [s]: initial contact, terminal contact. Of a foot
# against motion capture (gaitmap_imu) and nine other people (healthy_imu_turns), of a shank against
# the foot of the same leg (stroke_imu): docs/reference/gait.md#worn-sensors.
OFFSETS_S = {Place.FOOT: (0.0, -0.022), Place.SHANK: (-0.011, -0.039)}


class Doubt(StrEnum):
    """Why a stride of a worn sensor does not count."""

    TURNING = "turning"
    INTERRUPTED = "interrupted"
    SENSOR_MOVED = "sensor_moved"
    SAMPLES_LOST = "samples_lost"
    LOW_RATE = "low_rate"
    CONTACT_UNCLEAR = "contact_unclear"


@dataclass(frozen=True, slots=True)
class WearableStride:
    """A stride by its contacts: from one initial contact to the next.

    Attributes
    ----------
    place
        Where the sensor is worn, on which both contacts depend.
    initial_contact_s, terminal_contact_s
        Of its stance [s].
    stride_s, stance_s
        Its times [s].
    reasons
        Why it does not count.
    rate_hz
        Samples a second within it.
    foot_strike_rad
        How far the toes were up at initial contact, of a foot that is flat in stance.
    push_off_rad_s
        The foot's fastest rotation toes-down while the heel rises. It is no force and no power.
    shank_lean_rad
        How far the shank leans forward at terminal contact, against standing upright.
    """

    place: Place
    initial_contact_s: float
    terminal_contact_s: float
    stride_s: float
    stance_s: float
    reasons: tuple[Doubt, ...] = ()
    rate_hz: float = 0.0
    foot_strike_rad: float | None = None
    push_off_rad_s: float | None = None
    shank_lean_rad: float | None = None

    @property
    def end_s(self) -> float:
        """The initial contact that ends it [s]."""
        return self.initial_contact_s + self.stride_s

    @property
    def cadence_min(self) -> float:
        """Steps a minute of both legs: two a stride."""
        return 2 * 60 / self.stride_s

    @property
    def stance_share(self) -> float:
        """Stance as a share of the stride, 0 to 1."""
        return self.stance_s / self.stride_s
