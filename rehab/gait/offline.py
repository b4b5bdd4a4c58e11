"""Strides of a whole recording: the same code as online, and so the same numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from numpy.typing import ArrayLike

from rehab.gait.online import StrideDetector
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import Stride
from rehab.gait.two_legs import TwoLegDetector


def make_detector(
    sides: Collection[str], rate_hz: float, mass_kg: float, **settings: Any
) -> StrideDetector | TwoLegDetector:
    """Return the detector of one leg or of both.

    Parameters
    ----------
    sides
        "left", "right" or both.
    rate_hz, mass_kg, settings
        As in ``DetectorSettings``.

    Raises
    ------
    GaitInputError
        For settings that nothing can be measured with.
    """
    if len(sides) == 2:
        return TwoLegDetector(rate_hz, mass_kg, **settings)
    (side,) = sides
    return StrideDetector(rate_hz, mass_kg, side=side, **settings)


def measure_strides(
    t_s: ArrayLike,
    legs: Mapping[str, LegSamples],
    *,
    rate_hz: float,
    mass_kg: float,
    look_ahead_s: float = 0.05,
    frame: ArrayLike | None = None,
    **settings: Any,
) -> list[Stride]:
    """Return the strides of a recording of one leg or of both, in the order of their completion.

    Parameters
    ----------
    t_s
        Times [s], shape (n,).
    legs
        The channels of each leg by its side ("left", "right"), shape (n,).
    rate_hz, mass_kg, look_ahead_s, settings
        As in ``DetectorSettings``.
    frame
        The samples' numbers, as in ``StrideDetector.feed``.

    Returns
    -------
    The last stride of a leg is invalid where the record cuts it off.

    Raises
    ------
    GaitInputError
        For settings or channels that nothing can be measured from.
    """
    detector = make_detector(legs, rate_hz, mass_kg, look_ahead_s=look_ahead_s, **settings)
    return detector.feed_legs(t_s, legs, frame=frame) + detector.finish()
