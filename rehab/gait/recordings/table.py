"""Recorded channels in one table: columns, and what their file states about them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from rehab.gait.settings import RATE_MAX_HZ, RATE_MIN_HZ, RATE_TOLERANCE
from rehab.gait.signals.clock import find_period
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

TIME = re.compile(r"time|zeit|temps|tiempo|tempo|tijd")
COUNT = re.compile(r"frame|sample|bild|cadre|cuadro")
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6}
RATE_MOST_HZ = 100_000.0  # of any sensor; a larger one is damage
OVERLAP_S = 0.5  # a stance; files that share less are of different walks


class Table(dict[str, Floats]):
    """Columns by name, shape (n,) each.

    Attributes
    ----------
    units
        By column, as the file writes them; columns without a unit are missing.
    mass_kg
        Body mass [kg]; None where the file has none.
    notes
        What a person should know of how the columns were made.
    """

    def __init__(
        self,
        columns: Mapping[str, Floats],
        units: Mapping[str, str] | None = None,
        mass_kg: float | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        super().__init__(columns)
        self.units = dict(units or {})
        self.mass_kg = mass_kg
        self.notes = tuple(notes)


def resample_channel(values: Floats, rate_hz: float, time_s: Floats) -> Floats:
    """Return a channel that began with the recording, at other times.

    Parameters
    ----------
    values, rate_hz
        The channel, shape (n,), and its rate [Hz].
    time_s
        Wanted times, shape (m,); a channel of as many values has them already.
    """
    if len(values) == len(time_s) or not len(values):
        return np.resize(np.asarray(values, dtype=np.float64), len(time_s))
    resampled: Floats = np.interp(time_s, np.arange(len(values)) / rate_hz, values)
    return resampled


def find_time(columns: Mapping[str, Floats]) -> tuple[str, float] | None:
    """Return the column that is a time, and its factor to seconds; None where there is none.

    What counts by one is a time only if nothing else is, and a count of frames is none.
    """
    counts = [name for name, values in columns.items() if find_period(values[:1000]) == 1.0]
    ranked = sorted(
        (name for name in columns if not (name in counts and COUNT.search(name.lower()))),
        key=lambda name: (name in counts, not TIME.search(name.lower())),
    )
    for name in ranked:
        values = columns[name]
        if len(values) < 30 or not np.isfinite(values).all():
            continue
        steps, period = np.diff(values), find_period(values)
        if not (steps > 0).mean() > 0.99 or not period or steps.std() > 20 * period:
            continue
        for factor in TIME_UNITS.values():
            rate_hz = round(1 / (period * factor), 3)
            is_frame = factor == 1.0 and period == 1.0
            if RATE_MIN_HZ / RATE_TOLERANCE <= rate_hz <= RATE_MAX_HZ and not is_frame:
                return name, factor
    return None


def join_tables(tables: Mapping[str, Table]) -> Table:
    """Return the tables of one walk as one, at the common times of the one with most rows.

    Parameters
    ----------
    tables
        The tables by file name, each with its times by the same clock.

    Raises
    ------
    GaitInputError
        With the cure, for files without a time or of different times.
    """
    clocks = {}
    for name, table in tables.items():
        found = find_time(table)
        if found is None:
            raise GaitInputError(f"{name} has no column time. Export it with its times.")
        clocks[name] = (found[0], table[found[0]] * found[1])
    begin_s = max(time_s.min() for _, time_s in clocks.values())
    end_s = min(time_s.max() for _, time_s in clocks.values())
    if not end_s - begin_s >= OVERLAP_S:
        spans = ", ".join(f"{n} {t.min():g}-{t.max():g} s" for n, (_, t) in clocks.items())
        raise GaitInputError(f"These files share no time: {spans}. Give the files of one walk.")
    common = [t[(t >= begin_s) & (t <= end_s)] for _, t in clocks.values()]
    time_s = max(common, key=len)
    joined = Table({"time": time_s})
    for name, table in tables.items():
        clock, own_s = clocks[name]
        order = np.argsort(own_s, kind="stable")
        for column, values in table.items():
            if column != clock:
                own = column if column not in joined else f"{column} ({name})"
                joined[own] = np.interp(time_s, own_s[order], values[order])
                joined.units |= {own: table.units[column]} if column in table.units else {}
        joined.mass_kg = joined.mass_kg or table.mass_kg
        joined.notes += table.notes
    return joined
