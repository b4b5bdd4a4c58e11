"""Strides of a foot or shank with a gyroscope, whose sign is found."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rehab.gait.contacts.gyroscope import ContactKind, GyroscopeDetector
from rehab.gait.signals.clock import estimate_rate
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

STRIDE_MIN_S, STRIDE_MAX_S = 0.5, 6.0
STRIDES_MIN = 3


@dataclass(frozen=True, slots=True)
class GyroscopeStride:
    """A stride by its contacts: from one initial contact to the next.

    Attributes
    ----------
    initial_contact_s, terminal_contact_s
        Of its stance [s].
    stride_s, stance_s
        Its times [s].
    cadence_min
        Steps a minute of both legs: two a stride.
    """

    initial_contact_s: float
    terminal_contact_s: float
    stride_s: float
    stance_s: float
    cadence_min: float


def measure_gyroscope(
    t_s: Floats, rate_rad_s: Floats, *, segment: str = "foot"
) -> tuple[list[GyroscopeStride], float]:
    """Return the strides of a sagittal rate of rotation, and the sign with which it was read.

    With the right sign the sensor is nearly still between a contact and the next departure.

    Parameters
    ----------
    t_s, rate_rad_s
        Times [s] and rates [rad/s], shape (n,), about the axis to the left or to the right.
    segment
        "foot" or "shank".

    Raises
    ------
    GaitInputError
        With the cure, where nobody walks with either sign.
    """
    found = []
    for sign in (1.0, -1.0):
        strides = _find_strides(t_s, sign * rate_rad_s, segment)
        if len(strides) >= STRIDES_MIN:
            found.append((_find_motion(t_s, rate_rad_s, strides), sign, strides))
    if not found:
        raise GaitInputError(
            "No strides are found with either sign. Map the rate about the axis from left to "
            "right, in rad/s (COLUMN*0.01745 for degrees), of at least three strides."
        )
    _, sign, strides = min(found, key=lambda one: one[0])
    return strides, sign


def _find_strides(t_s: Floats, rate_rad_s: Floats, segment: str) -> list[GyroscopeStride]:
    contacts = GyroscopeDetector(estimate_rate(t_s), segment=segment).feed(t_s, rate_rad_s)
    begins = [c.time_s for c in contacts if c.kind is ContactKind.INITIAL]
    ends = [c.time_s for c in contacts if c.kind is ContactKind.TERMINAL]
    strides = []
    for begin_s, next_s in pairwise(begins):
        inside = [end_s for end_s in ends if begin_s < end_s < next_s]
        if inside and STRIDE_MIN_S <= next_s - begin_s <= STRIDE_MAX_S:
            stride_s = next_s - begin_s
            strides.append(
                GyroscopeStride(
                    begin_s, inside[0], stride_s, inside[0] - begin_s, 2 * 60 / stride_s
                )
            )
    return strides


def _find_motion(t_s: Floats, rate_rad_s: Floats, strides: list[GyroscopeStride]) -> float:
    """Return how much the sensor turns in mid-stance [rad/s]."""
    turned = []
    for stride in strides:
        begin_s = stride.initial_contact_s
        part = slice(
            *np.searchsorted(
                t_s, (begin_s + 0.2 * stride.stance_s, begin_s + 0.6 * stride.stance_s)
            )
        )
        if part.stop > part.start:
            turned.append(float(np.abs(rate_rad_s[part]).mean()))
    return float(np.median(turned)) if turned else np.inf
