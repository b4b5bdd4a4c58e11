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
    is_overground: bool = False,
    side: str | None = None,
    frame: ArrayLike | None = None,
) -> list[Stride]:
    """Return the strides of one leg of a recording.

    Parameters
    ----------
    t_s, force_n, moment_nm, angle_rad, forward_n, position_m
        Channels of shape (n,), as in ``StrideDetector.feed``.
    rate_hz, mass_kg, look_ahead_s, is_velocity, is_overground, side
        As in ``StrideDetector``.
    frame
        The samples' numbers, as in ``StrideDetector.feed``.

    Returns
    -------
    All strides in order of time, the last one invalid where the record cuts it off.

    Raises
    ------
    GaitInputError
        For settings or channels that nothing can be measured from.
    """
    detector = StrideDetector(
        rate_hz,
        mass_kg,
        look_ahead_s=look_ahead_s,
        is_velocity=is_velocity,
        is_overground=is_overground,
        side=side,
    )
    found = detector.feed(t_s, force_n, moment_nm, angle_rad, forward_n, position_m, frame=frame)
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
    is_overground: bool = False,
    frame: ArrayLike | None = None,
) -> list[Stride]:
    """Return the strides of both legs of a recording.

    Parameters
    ----------
    t_s, left, right
        Times [s], shape (n,), and the channels of each leg, as in ``TwoLegDetector.feed``.
    rate_hz, mass_kg, look_ahead_s, is_velocity, is_overground, frame
        As in ``TwoLegDetector``.

    Returns
    -------
    The strides of both legs in the order in which they were complete.

    Raises
    ------
    GaitInputError
        For settings or channels that nothing can be measured from.
    """
    detector = TwoLegDetector(
        rate_hz,
        mass_kg,
        look_ahead_s=look_ahead_s,
        is_velocity=is_velocity,
        is_overground=is_overground,
    )
    return detector.feed(t_s, left, right, frame=frame) + detector.finish()
