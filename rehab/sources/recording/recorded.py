"""A session as it was recorded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from rehab.training.phases import Phase
from rehab.training.steps import Measurement, Side


@dataclass(frozen=True, slots=True)
class RecordedStride:
    """One row: the measurement, and what was shown and decided when it was recorded.

    ``row`` is its number in a spreadsheet (the header is row 1), ``phase`` an index into the
    recording's phases. ``recorded_shown`` is in the unit of the value.
    """

    row: int
    measurement: Measurement
    phase: int
    recorded_shown: float | None
    recorded_hit: bool | None


@dataclass(frozen=True, slots=True)
class Recording:
    """A recorded session. Iterating yields its measurements.

    ``trained_side`` is None where neither the file nor the caller says which leg was trained; the
    measurements then carry the left one. ``goal`` is in the unit of the value.
    """

    name: str
    layout: str
    trained_side: Side | None
    phases: tuple[Phase, ...]
    goal: float | None
    strides: tuple[RecordedStride, ...]

    def __iter__(self) -> Iterator[Measurement]:
        return (stride.measurement for stride in self.strides)

    def phases_at_gain_one(self) -> tuple[Phase, ...]:
        """Return the same phases with a gain of 1, so that real values are shown."""
        return tuple(replace(phase, gain=1.0) for phase in self.phases)
