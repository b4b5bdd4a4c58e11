"""What a layout defines: which columns hold what, and how to read reasons and phases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rehab.sources.recording.table import RecordedTable, Row, quote
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase
from rehab.training.steps import Side


@dataclass(frozen=True, slots=True)
class Layout:
    """Which columns hold what, and two functions that read reasons and phase of a row.

    ``required`` columns must be there; any other that is named here may be missing. Without a
    column ``time_s``, strides lie ``stride_s`` [s] apart. ``extra`` columns are kept as further
    named values; None keeps every column that has no other use.
    """

    name: str
    required: tuple[str, ...]
    value: str
    number: str
    read_reasons: Callable[[Row], tuple[str, ...]]
    read_phase: Callable[[Row], Phase]
    time_s: str = ""
    stride_s: float = 0.0
    side: str = ""
    goal: str = ""
    shown: str = ""
    hit: str = ""
    other: tuple[str, ...] = ()
    extra: tuple[str, ...] | None = None

    def missing_in(self, table: RecordedTable) -> list[str]:
        """Return the required columns that a table does not have."""
        return [column for column in self.required if column not in table.columns]

    def extra_in(self, table: RecordedTable) -> list[str]:
        """Return the columns of a table that are kept as further named values."""
        if self.extra is not None:
            return [column for column in self.extra if column in table.columns]
        used = {self.number, self.time_s, self.side, self.value, self.goal, self.shown, self.hit}
        used.update(self.other)
        return [column for column in table.columns if column not in used]


_SIDES = {"l": Side.LEFT, "left": Side.LEFT, "r": Side.RIGHT, "right": Side.RIGHT}


def read_side(row: Row, layout: Layout) -> Side | None:
    """Return the leg of a row, None where the file has no column for it."""
    if not row.has(layout.side):
        return None
    side = _SIDES.get(row.text(layout.side).lower())
    if side is None:
        found = quote(row.text(layout.side))
        raise row.error(f"{found} is no leg. Write L or R.", layout.side)
    return side


def make_row_phase(
    row: Row, column: str, kind: str, name: str, feedback: bool, gain: float
) -> Phase:
    """Return a row's phase. Raises RecordingError where the column's gain cannot be used."""
    try:
        return Phase(kind=kind, name=name, feedback=feedback, gain=gain)
    except InvalidSetting as problem:
        raise row.error(str(problem), column) from None
