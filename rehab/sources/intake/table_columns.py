"""How tables of samples are read: which of their columns are channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rehab.gait.recordings.column_mapping import SignalColumn
from rehab.sources.intake.alignment import Channel, Floats

PLANS = 64  # kept at most; streams have one or two


@dataclass(frozen=True, slots=True)
class TablePlan:
    """Which columns of a table are channels, with their factors and delays [s]."""

    places: list[int]
    channels: list[Channel]
    factors: Floats  # shape (channels, 1)
    delays_s: list[float]
    frame: int | None  # the column of frame numbers


class TablePlans:
    """Plans of tables, kept from one to the next with the same columns.

    Parameters
    ----------
    columns
        Channels by the name of their column, with its factor and delay.
    frame
        Name of the column with frame numbers, if there is one.
    """

    def __init__(
        self, columns: Mapping[str, tuple[Channel, SignalColumn]], frame: str | None
    ) -> None:
        self._columns = columns
        self._frame = frame
        self._plans: dict[tuple[str, ...], TablePlan] = {}

    def find(self, names: tuple[str, ...]) -> TablePlan:
        """Return how a table with these columns is read."""
        plan = self._plans.get(names)
        if plan is None:
            if len(self._plans) >= PLANS:
                self._plans.clear()
            places = [place for place, name in enumerate(names) if name in self._columns]
            used = [self._columns[names[place]] for place in places]
            plan = self._plans[names] = TablePlan(
                places=places,
                channels=[channel for channel, _ in used],
                factors=np.array([[column.factor] for _, column in used]).reshape(-1, 1),
                delays_s=[column.delay_s for _, column in used],
                frame=names.index(self._frame) if self._frame in names else None,
            )
        return plan
