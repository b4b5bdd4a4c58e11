"""A stride as a source measured it, and the same stride once it is scored."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from rehab.training.measures import Measure
from robot.wire.limits import TIME_MAX_S

# The extra value with what a source sent as a step's value, where another one is trained.
SENT_VALUE = "sent_value"
# The extra value with the heart rate at a stride [1/min].
HEART_RATE = "heart_rate"


class Side(StrEnum):
    """A leg, named as hardware names it."""

    LEFT = "left"
    RIGHT = "right"


class InvalidReason(StrEnum):
    """Why a step is invalid. Sources may add codes of their own."""

    MISSING = "missing"
    NOT_FINITE = "not_finite"
    OUT_OF_BOUNDS = "out_of_bounds"
    TIME_BACKWARDS = "time_backwards"
    PAUSED = "paused"
    FLAGGED = "flagged"
    FORCE_LOST = "force_lost"
    LATE = "late"  # its samples came late from the lab


class InvalidMeasurement(ValueError):
    """A stride that cannot be stored; the message says what is wrong with it."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """What a source reports of one stride.

    Attributes
    ----------
    number
        Counts a session's strides from 1 without gaps.
    time_s
        When the stride ended, by the source's own clock [s].
    side
        Its leg.
    value
        In the unit of the session's measure; None where there is none.
    reasons
        Why the source doubts it; they make the step invalid.
    extra
        Further named values.
    rules_version
        Of a stored stride: the rules that it was scored by. None for a new one.

    Raises
    ------
    InvalidMeasurement
        For a number below 1, a time that cannot be in seconds and an extra value that is not
        finite.
    """

    number: int
    time_s: float
    side: Side
    value: float | None
    reasons: tuple[str, ...] = ()
    extra: Mapping[str, float] = field(default_factory=dict)
    rules_version: int | None = None

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


def select_value(measurement: Measurement, measure: Measure) -> Measurement:
    """Return the measurement with the value that is trained: that of the measure's channel.

    The value that was sent stays as the extra value ``sent_value``. Without the channel there is no
    value. A measurement that was selected already is returned as it is.
    """
    if not measure.channel:
        return measurement
    extra, named = measurement.extra, measurement.extra.get(measure.channel)
    value = None if named is None else float(named)  # in ``extra`` an int stays an int
    if value == measurement.value:
        return measurement
    if measurement.value is not None and math.isfinite(measurement.value):
        extra = {SENT_VALUE: measurement.value, **extra}
    return replace(measurement, value=value, extra=extra)


@dataclass(frozen=True, slots=True)
class ScoredStep:
    """A stride with its verdict: all that the log stores of it, except when it arrived.

    Attributes
    ----------
    number, time_s, side, value, extra
        As measured.
    gain, goal, phase
        In force when it was scored: ratio, in the value's unit, and the phase's index.
    shown, performance, hit
        None where nothing can be judged (invalid step, other leg, goal not known yet).
    close
        Whether the value is too uncertain for its verdict to count (``closeness``).
    points
        None where points do not exist (those cases, a phase without feedback, a valence without
        points); 0 where they exist but none was earned.
    valid, reasons
        Whether it counts, and why not.
    rules_version
        Of the rules that scored it.
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
    close: bool = False


def find_invalid_reasons(measurement: Measurement, measure: Measure) -> tuple[str, ...]:
    """Return why a measurement is invalid; nothing for a valid one.

    The source's own reasons come first, then at most one of ours, about the value. A stored step
    that is scored again keeps its reasons.

    Parameters
    ----------
    measurement
        The stride.
    measure
        What is trained, with the bounds of its values.
    """
    value, reasons = measurement.value, measurement.reasons
    if value is None:
        # A value that was not finite is stored as None, and is not missing.
        return (
            reasons
            if InvalidReason.NOT_FINITE in reasons
            else add_reason(reasons, InvalidReason.MISSING)
        )
    if measure.value_min <= value <= measure.value_max:
        return reasons
    return add_reason(
        reasons, InvalidReason.OUT_OF_BOUNDS if math.isfinite(value) else InvalidReason.NOT_FINITE
    )


def add_reason(reasons: tuple[str, ...], reason: str) -> tuple[str, ...]:
    """Return the reasons with one more, each only once."""
    return reasons if reason in reasons else (*reasons, reason)
