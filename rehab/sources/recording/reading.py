"""From a file to a recorded session: everything is checked before anything is returned."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from rehab.sources.recording.csv_text import parse_table
from rehab.sources.recording.layout import Layout, read_side
from rehab.sources.recording.layouts import choose_layout
from rehab.sources.recording.recorded import RecordedStride, Recording
from rehab.sources.recording.table import RecordingError, Row, quote
from rehab.training.phases import Phase
from rehab.training.steps import Measurement, Side

# The widest layout takes about 2 MB for an hour of walking: 50 MB are a day of it.
MAX_BYTES = 50_000_000
# Clocks count from a session's start or from 1970 (2e9 s); sums of anything larger lose the
# milliseconds that strides need.
MAX_TIME_S = 1e12


def read_recording(
    path: str | Path, layout: str | None = None, *, trained_side: Side | None = None
) -> Recording:
    """Return the recording in a file; see ``parse_recording``.

    Raises RecordingError also where there is no such file or it cannot be read.
    """
    path = Path(path)
    # A file's name may hold bytes that are no text, and could then be neither printed nor stored.
    place, name = (os.fsencode(text).decode(errors="replace") for text in (path, path.name))
    try:
        if not path.exists():
            raise RecordingError(f"There is no recording {place}. Check the path.")
        if not path.is_file():
            raise RecordingError(f"{place} is not a file. Name a CSV file.")
        if path.stat().st_size > MAX_BYTES:
            raise RecordingError(
                f"Recording {name} is larger than {MAX_BYTES // 1_000_000} MB. "
                "Split it into sessions."
            )
        data = path.read_bytes()
    except OSError as problem:
        raise RecordingError(
            f"Recording {place} cannot be read: {problem.strerror}. Check the path and its rights."
        ) from None
    return parse_recording(data, name, layout, trained_side=trained_side)


def parse_recording(
    data: bytes, name: str, layout: str | None = None, *, trained_side: Side | None = None
) -> Recording:
    """Return the recording in a file's bytes.

    Parameters
    ----------
    data
        The whole file.
    name
        What messages call it.
    layout
        A name from ``LAYOUTS``; otherwise the header decides.
    trained_side
        The trained leg, needed where the file holds strides of both.

    Raises
    ------
    RecordingError
        For the first problem found, naming row, column and cure. Nothing is returned before every
        row has been checked. Values that are missing, not finite or out of bounds are not errors:
        scoring gives such a stride its reason.
    """
    table = parse_table(data, name)
    used = choose_layout(table, layout)
    rows = table.rows
    sides = [read_side(row, used) for row in rows]
    trained = _choose_trained_side(name, sides, trained_side)
    phases, places = _read_phases(rows, [side in (None, trained) for side in sides], used)
    return Recording(
        name=name,
        layout=used.name,
        trained_side=trained,
        phases=phases,
        goal=_read_goal(rows, used),
        strides=tuple(_read_strides(rows, used, sides, places, trained or Side.LEFT)),
    )


def _choose_trained_side(name: str, sides: list[Side | None], wanted: Side | None) -> Side | None:
    found = {side for side in sides if side is not None}
    if not found:
        return wanted
    if wanted is None and len(found) > 1:
        raise RecordingError(
            f"Recording {name} holds strides of both legs. Say which one is trained, or keep only "
            "its rows."
        )
    if wanted is not None and wanted not in found:
        raise RecordingError(
            f"Recording {name} holds no stride of the {wanted} leg, which is to be trained. "
            "Choose the other leg or another recording."
        )
    return wanted or found.pop()


def _read_phases(
    rows: list[Row], trained: list[bool], layout: Layout
) -> tuple[tuple[Phase, ...], list[int]]:
    """Return the runs of rows with the same phase, and for each row the index of its run."""
    phases: list[Phase] = []
    places: list[int] = []
    pairs = zip(rows, trained, strict=True)
    for phase, group in groupby(pairs, key=lambda pair: layout.read_phase(pair[0])):
        run = list(group)
        strides = sum(is_trained for _, is_trained in run)
        if not strides:
            raise run[0][0].error(
                f"the phase {quote(phase.name)} that begins here has no stride of the trained leg. "
                "Name its rows like those before or after them."
            )
        places.extend([len(phases)] * len(run))
        phases.append(replace(phase, strides=strides))
    return tuple(phases), places


def _read_goal(rows: list[Row], layout: Layout) -> float | None:
    """Return the goal that all rows share, None where all are blank."""
    goal = rows[0].number_in(layout.goal)
    for row in rows:
        here = row.number_in(layout.goal)
        if here is not None and not 0 < here < math.inf:
            raise row.error(f"{here} cannot be a goal. Write a number above 0.", layout.goal)
        if here != goal:
            before, after = ("blank" if it is None else str(it) for it in (goal, here))
            raise row.error(
                f"the goal changes from {before} to {after}. A recording has one goal: split the "
                "file here, or give every row the same.",
                layout.goal,
            )
    return goal


def _read_strides(
    rows: list[Row],
    layout: Layout,
    sides: list[Side | None],
    places: list[int],
    trained: Side,
) -> Iterator[RecordedStride]:
    extra_columns = layout.extra_in(rows[0].table)
    last_s = -MAX_TIME_S
    for number, (row, side, place) in enumerate(zip(rows, sides, places, strict=True), start=1):
        _check_number(row, layout, number)
        last_s = time_s = _read_time(row, layout, number, last_s)
        extra = {column: row.number_in(column) for column in extra_columns}
        yield RecordedStride(
            row=row.number,
            measurement=Measurement(
                number=number,
                time_s=time_s,
                side=side or trained,
                value=row.number_in(layout.value),
                reasons=layout.read_reasons(row),
                extra={
                    column: value
                    for column, value in extra.items()
                    if value is not None and math.isfinite(value)
                },
            ),
            phase=place,
            recorded_shown=row.number_in(layout.shown),
            recorded_hit=row.flag_in(layout.hit),
        )


def _check_number(row: Row, layout: Layout, expected: int) -> None:
    """Raise RecordingError where rows are repeated, left out or out of order."""
    if not row.has(layout.number):
        return
    number = row.whole_in(layout.number)
    if number != expected:
        follows = f"follows {expected - 1}" if expected > 1 else "comes first"
        raise row.error(
            f"stride number {number} {follows}, where {expected} is due. Strides count from 1 in "
            "the order walked, none twice and none left out: sort the rows, or export again.",
            layout.number,
        )


def _read_time(row: Row, layout: Layout, number: int, last_s: float) -> float:
    """Return a stride's time [s]. Raises RecordingError where it decreases."""
    if not layout.time_s:
        return (number - 1) * layout.stride_s
    time_s = row.finite_in(layout.time_s)
    if abs(time_s) > MAX_TIME_S:
        raise row.error(f"{time_s} is no time in seconds. Correct it.", layout.time_s)
    if time_s < last_s:
        raise row.error(
            f"time goes back from {last_s} s to {time_s} s. Sort the rows in the order walked, "
            "or export again.",
            layout.time_s,
        )
    return time_s
