"""A session's strides as a recording that GARRY plays again (layout "plain")."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

from rehab.exports.research.sinks import Rows
from rehab.people.web.csv_tables import CsvWriter
from rehab.sources.recording.plain import PLAIN

NAMES = (
    *("number", "time_s", "side", "value", "goal", "shown", "hit", "valid", "reason"),
    *("phase", "kind", "feedback", "gain"),
)
# Column of the recording: column of the table of steps.
RENAMED = {"time_s": "time", "reason": "reasons", "phase": "phase_name", "kind": "phase_kind"}
COLUMNS = {name: RENAMED.get(name, name) for name in NAMES}


class RecordingSink:
    """Rows of ``STEPS`` as a recording. ``extras``: further named values that get a column.

    A name that the layout itself uses is left out; ``steps.csv`` has it. A recording has one goal:
    without ``has_goal`` it has none, since a session's goal may change on its way.
    """

    def __init__(self, file: Path, extras: Sequence[str], *, has_goal: bool) -> None:
        self._file = file.open("w", encoding="utf-8", newline="")
        self._writer = CsvWriter(self._file)
        self._columns = {a: b for a, b in COLUMNS.items() if has_goal or a != PLAIN.goal}
        used = {*COLUMNS, *PLAIN.required, *PLAIN.other}
        self._extras = [name for name in extras if name not in used]
        self._writer.write([[*self._columns, *self._extras]])

    def write(self, rows: Rows) -> None:
        """Write some strides."""
        cells = attrgetter(*self._columns.values())
        for row in rows:
            extra: dict[str, Any] = row.extra or {}
            self._writer.write([(*cells(row), *map(extra.get, self._extras))])

    def close(self) -> None:
        """Close the file."""
        self._file.close()
