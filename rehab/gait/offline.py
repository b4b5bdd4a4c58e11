"""Strides of a whole recording: the same code as online, and so the same numbers."""

from __future__ import annotations

from numpy.typing import ArrayLike

from rehab.gait.online import StrideDetector
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import Stride
from rehab.gait.two_legs import TwoLegDetector


def measure_strides(
    t_s: ArrayLike,
    force_n: ArrayLike,
    moment_nm: ArrayLike,
    angle_rad: ArrayLike,
    forward_n: ArrayLike | None = None,
    position_m: ArrayLike | None = None,
    *,
    rate_hz: float,
    mass_kg: float,
    look_ahead_s: float = 0.05,
    is_velocity: bool = False,
    side: str | None = None,
) -> list[Stride]:
    """Give the strides of one leg. Channels and settings are those of ``StrideDetector``."""
    detector = StrideDetector(
        rate_hz, mass_kg, look_ahead_s=look_ahead_s, is_velocity=is_velocity, side=side
    )
    found = detector.feed(t_s, force_n, moment_nm, angle_rad, forward_n, position_m)
    return found + detector.finish()


def measure_both_legs(
    t_s: ArrayLike,
    left: LegSamples,
    right: LegSamples,
    *,
    rate_hz: float,
    mass_kg: float,
    look_ahead_s: float = 0.05,
    is_velocity: bool = False,
) -> list[Stride]:
    """Give the strides of both legs. Channels and settings are those of ``TwoLegDetector``."""
    detector = TwoLegDetector(rate_hz, mass_kg, look_ahead_s=look_ahead_s, is_velocity=is_velocity)
    return detector.feed(t_s, left, right) + detector.finish()
