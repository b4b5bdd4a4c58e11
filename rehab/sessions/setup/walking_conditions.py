"""How a patient walked: device, belt speed, body-weight support. They change no score."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from rehab.training.measures import InvalidSetting

MAX_DEVICE_LETTERS = 64
BELT_M_S = (0.0, 5.0)
SUPPORT_PERCENT = (0.0, 100.0)


@dataclass(frozen=True, slots=True)
class WalkingConditions:
    """The covariates of a session; None or empty where they are not known.

    Attributes
    ----------
    device
        What the patient walks with or on: treadmill, orthosis, cane.
    belt_speed_m_s
        Speed of the treadmill's belt [m/s].
    weight_support_percent
        Share of the body's weight that a harness carries [%].

    Raises
    ------
    InvalidSetting
        For what no treadmill or harness does.
    """

    device: str = ""
    belt_speed_m_s: float | None = None
    weight_support_percent: float | None = None

    def __post_init__(self) -> None:
        if len(self.device) > MAX_DEVICE_LETTERS:
            raise InvalidSetting(
                "Describe the device in {most} letters at most.", most=MAX_DEVICE_LETTERS
            )
        if not _is_within(self.belt_speed_m_s, BELT_M_S):
            raise InvalidSetting("A belt runs at 0 to 5 m/s. Give meters per second.")
        if not _is_within(self.weight_support_percent, SUPPORT_PERCENT):
            raise InvalidSetting("Body-weight support is 0 to 100 % of the body's weight.")


def _is_within(value: float | None, bounds: tuple[float, float]) -> bool:
    return value is None or (isfinite(value) and bounds[0] <= value <= bounds[1])
