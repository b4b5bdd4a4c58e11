"""The known layouts, and how a file's header chooses among them."""

from __future__ import annotations

from rehab.sources.recording.hebb import HEBB03, HEBB91
from rehab.sources.recording.layout import Layout
from rehab.sources.recording.plain import PLAIN
from rehab.sources.recording.table import RecordedTable, RecordingError, quote

LAYOUTS: dict[str, Layout] = {layout.name: layout for layout in (HEBB03, HEBB91, PLAIN)}


def choose_layout(table: RecordedTable, name: str | None = None) -> Layout:
    """Return the layout of that name, or the one whose required columns the table has.

    Raises RecordingError where the name is unknown, columns are missing or several layouts fit.
    """
    known = ", ".join(LAYOUTS)
    if name is not None and name not in LAYOUTS:
        raise RecordingError(f"There is no layout {quote(name)}. Known layouts: {known}.")
    candidates = [LAYOUTS[name]] if name is not None else list(LAYOUTS.values())
    fitting = [layout for layout in candidates if not layout.missing_in(table)]
    if len(fitting) > 1:
        raise RecordingError(
            f"Recording {table.name} fits the layouts {', '.join(fit.name for fit in fitting)}. "
            "Say which is meant, or delete the columns of the other."
        )
    if fitting:
        return fitting[0]

    def likeness(layout: Layout) -> tuple[float, int]:
        missing = len(layout.missing_in(table))
        return 1 - missing / len(layout.required), -missing

    missing = max(candidates, key=likeness).missing_in(table)
    raise RecordingError(
        f"Recording {table.name} has no column{'s' * (len(missing) > 1)} {', '.join(missing)}. "
        f"Known layouts: {known}."
    )
