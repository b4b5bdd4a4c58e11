"""A stride as a source measured it, and the same stride once it is scored."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from rehab.training.measures import Measure
from robot.wire.limits import TIME_MAX_S


class Side(StrEnum):
    """A leg as hardware names it."""

    LEFT = "left"
    RIGHT = "right"


class Reason(StrEnum):
    """Why a step does not count. Sources may add codes of their own."""

    MISSING = "missing"
    NOT_FINITE = "not_finite"
    OUT_OF_BOUNDS = "out_of_bounds"
    TIME_BACKWARDS = "time_backwards"
    PAUSED = "paused"
    FLAGGED = "flagged"
    FORCE_LOST = "force_lost"


class InvalidMeasurement(ValueError):
    """A stride that cannot even be stored; the message says what is wrong with it."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """What a source says of one stride.

    ``number`` counts a session's strides from 1 without gaps; ``time_s`` is the source's own clock;
    ``value`` is in the unit of the session's measure, None where none could be had; ``reasons`` are
    the source's own doubts and make the step invalid; ``extra`` holds further named values.
    Raises InvalidMeasurement for a number below 1, a time that cannot be in seconds and an extra
    value that is not finite.
    """

    number: int
    time_s: float
    side: Side
    value: float | None
    reasons: tuple[str, ...] = ()
    extra: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.number < 1:
            raise InvalidMeasurement(f"Stride numbers begin at 1, not {self.number}.")
        if not -TIME_MAX_S <= self.time_s <= TIME_MAX_S:
            raise InvalidMeasurement(
                f"Stride {self.number} needs a time in seconds, not {self.time_s:g}."
            )
        for name, value in self.extra.items():
            if not math.isfinite(value):
                raise InvalidMeasurement(
                    f"Stride {self.number}: {name} is not finite; leave it out."
                )


@dataclass(frozen=True, slots=True)
class ScoredStep:
    """A stride with its verdict: everything that the log keeps of it but the moment it arrived.

    ``shown``, ``performance`` and ``hit`` are None where there is nothing to judge (invalid step,
    other leg, goal not known yet). ``points`` is None where points do not exist (those cases, a
    phase without feedback, a valence without points) and 0 where they exist but none was earned.
    """

    number: int
    time_s: float
    side: Side
    value: float | None
    gain: float
    shown: float | None
    goal: float | None
    performance: float | None
    hit: bool | None
    points: int | None
    valid: bool
    reasons: tuple[str, ...]
    phase: int
    extra: Mapping[str, float]
    rules_version: int


def find_reasons(measurement: Measurement, measure: Measure) -> tuple[str, ...]:
    """Give the reasons why this measurement cannot count; none for a good one.

    The source's own reasons come first; then at most one of ours, about the value. A stored step
    that is measured again gets the reasons it has.
    """
    value, reasons = measurement.value, measurement.reasons
    if value is None:
        # A value that is not finite is stored as None; it was not missing.
        return reasons if Reason.NOT_FINITE in reasons else add_reason(reasons, Reason.MISSING)
    if measure.value_min <= value <= measure.value_max:
        return reasons
    return add_reason(reasons, Reason.OUT_OF_BOUNDS if math.isfinite(value) else Reason.NOT_FINITE)


def add_reason(reasons: tuple[str, ...], reason: str) -> tuple[str, ...]:
    """Give the reasons with one more, each only once."""
    return reasons if reason in reasons else (*reasons, reason)
