"""A session's scored strides as columns, and what is asked of a part of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from rehab.studies.analysis.mixed_model import Flags, Floats
from rehab.training.goals import MIN_BASELINE_STRIDES
from rehab.training.phases import Phase


@dataclass(frozen=True)
class Walk:
    """One session: n strides of the trained leg, in their order.

    Attributes
    ----------
    phases
        The plan's, to which ``phase`` is an index.
    higher_is_better
        Of what is measured.
    phase, time_s, gain
        Shape (n,): index, end of the stride [s], ratio.
    value, goal, performance
        Shape (n,), NaN where there is none: in the measure's unit, twice, and shown / goal.
    hit, valid
        Shape (n,). What has no performance is no hit.
    extra
        Further measured channels by name, shape (n,), NaN where there is none.
    """

    OF_SESSION: ClassVar = ("phases", "higher_is_better")  # the other fields are columns

    phases: tuple[Phase, ...]
    higher_is_better: bool
    phase: NDArray[np.int64]
    time_s: Floats
    value: Floats
    gain: Floats
    goal: Floats
    performance: Floats
    hit: Flags
    valid: Flags
    extra: dict[str, Floats]

    @cached_property
    def with_feedback(self) -> Flags:
        """Which strides were walked in phases with feedback, shape (n,)."""
        return self._in([phase.feedback for phase in self.phases])

    def in_kind(self, kind: str) -> Flags:
        """Return which strides were walked in phases of a kind, shape (n,)."""
        return self._in([phase.kind == kind for phase in self.phases])

    def _in(self, chosen: Sequence[bool]) -> Flags:
        return np.array(chosen, dtype=bool)[self.phase]

    @cached_property
    def baseline(self) -> float | None:
        """Mean of the valid baseline strides, in the measure's unit; None of too few, or of 0."""
        values = self.value[self.in_kind("baseline") & self.valid]
        if len(values) < MIN_BASELINE_STRIDES or not (mean := float(values.mean())) > 0:
            return None
        return mean

    def values(self, where: Flags) -> Floats:
        """Return the valid values among some strides, in their order."""
        return self.value[where & self.valid]

    @property
    def trained(self) -> Floats:
        """The valid values of strides with feedback, in their order."""
        return self.values(self.with_feedback)


# What is read of each stride of the trained leg, in this order.
COLUMNS = tuple(column.name for column in fields(Walk) if column.name not in Walk.OF_SESSION)


def read_walk(
    phases: Sequence[Phase], rows: Iterable[Sequence[Any]], *, higher_is_better: bool
) -> Walk:
    """Return the walk of rows that have ``COLUMNS``, all of the trained leg.

    Parameters
    ----------
    phases
        The plan's.
    rows
        One for each stride, in their order; None where there is no value, goal or performance.
    higher_is_better
        Of what is measured.
    """
    found = list(zip(*rows, strict=True)) or [()] * len(COLUMNS)
    columns: dict[str, Any] = dict(zip(COLUMNS, found, strict=True))
    extra = columns.pop("extra")
    names = sorted({name for channels in extra for name in channels})
    columns["hit"] = [one is True for one in columns["hit"]]
    types = {"phase": np.int64, "hit": bool, "valid": bool}
    return Walk(
        phases=tuple(phases),
        higher_is_better=higher_is_better,
        extra={name: _floats([channels.get(name) for channels in extra]) for name in names},
        # None becomes NaN
        **{name: np.array(one, types.get(name, np.float64)) for name, one in columns.items()},
    )


def _floats(column: Sequence[float | None]) -> Floats:
    return np.array(column, dtype=np.float64)
