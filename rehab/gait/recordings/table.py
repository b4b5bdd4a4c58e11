"""Recorded channels in one table: columns, and what their file states about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

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


def join_tables(tables: Mapping[str, Table]) -> Table:
    """Return the tables of one walk as one, at the common times of the one with most rows.

    Parameters
    ----------
    tables
        The tables by file name, each with a column ``time`` [s] of the same clock.

    Raises
    ------
    GaitInputError
        With the cure, for files without a time or of different times.
    """
    for name, table in tables.items():
        if "time" not in table or not np.isfinite(table["time"]).all():
            raise GaitInputError(f"{name} has no column time. Export it with its times.")
    begin_s = max(table["time"].min() for table in tables.values())
    end_s = min(table["time"].max() for table in tables.values())
    if not end_s - begin_s >= OVERLAP_S:
        spans = ", ".join(
            f"{n} {t['time'].min():g}-{t['time'].max():g} s" for n, t in tables.items()
        )
        raise GaitInputError(f"These files share no time: {spans}. Give the files of one walk.")

    def count(table: Table) -> int:
        return int(((table["time"] >= begin_s) & (table["time"] <= end_s)).sum())

    time_s = max(tables.values(), key=count)["time"]
    time_s = time_s[(time_s >= begin_s) & (time_s <= end_s)]
    joined = Table({"time": time_s})
    for name, table in tables.items():
        order = np.argsort(table["time"], kind="stable")
        for column, values in table.items():
            if column != "time":
                own = column if column not in joined else f"{column} ({name})"
                joined[own] = np.interp(time_s, table["time"][order], values[order])
                joined.units |= {own: table.units[column]} if column in table.units else {}
        joined.mass_kg = joined.mass_kg or table.mass_kg
        joined.notes += table.notes
    return joined
