"""Recorded signals in CSV files: a header, then one row a sample."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rehab.gait.recordings.columns import ColumnMap, find_layout, read_column_map
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import GaitInputError

MAX_HEADER = 64 * 1024


def read_header(path: Path) -> tuple[list[str], str]:
    """Return a file's column names and its delimiter.

    Raises
    ------
    GaitInputError
        For a file that is not text.
    OSError
        For a file that cannot be read.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            first = file.readline(MAX_HEADER)
    except UnicodeDecodeError:
        raise GaitInputError(f"{path.name} is no text. Save it as CSV UTF-8.") from None
    delimiter = max(",;\t", key=first.count)
    return [name.strip() for name in next(csv.reader([first], delimiter=delimiter), [])], delimiter


def read_signals(
    path: Path, pairs: Sequence[str] | None = None
) -> tuple[Floats, dict[str, LegSamples]]:
    """Return times [s] and each leg's channels of a CSV file.

    Parameters
    ----------
    path
        The file. A cell that is not a number is a missing sample: NaN.
    pairs
        Which column is which channel, as for ``read_column_map``; None to decide by the header.

    Returns
    -------
    Times, shape (n,), and ``LegSamples`` of shape (n,) by side, in SI units with our signs.

    Raises
    ------
    GaitInputError
        With the cure, for columns that are missing or empty and for a file without samples.
    OSError
        For a file that cannot be read.
    """
    header, delimiter = read_header(path)
    columns: ColumnMap = read_column_map(pairs) if pairs else find_layout(header)
    missing = [column.name for column in columns.columns if column.name not in header]
    if missing:
        raise GaitInputError(
            f"{path.name} has no column {', '.join(missing)}. It has: {', '.join(header)}."
        )
    names = [column.name for column in columns.columns]
    table = np.genfromtxt(
        path,
        delimiter=delimiter,
        skip_header=1,
        usecols=[header.index(name) for name in names],
        encoding="utf-8-sig",
        invalid_raise=False,
        ndmin=2,
    )
    if not table.shape[0]:
        raise GaitInputError(f"{path.name} has a header but no samples. Export it again.")
    empty = [name for name, values in zip(names, table.T, strict=True) if np.isnan(values).all()]
    if empty:
        raise GaitInputError(f"{path.name}: column {', '.join(empty)} holds no numbers.")
    scaled = iter(
        values * column.factor for column, values in zip(columns.columns, table.T, strict=True)
    )
    time = next(scaled)
    legs = {}
    for side, leg in columns.legs.items():
        channels = {channel: next(scaled) for channel in leg}
        legs[side] = LegSamples(
            channels["force"],
            channels["moment"],
            channels["angle"],
            channels.get("forward"),
            channels.get("position"),
        )
    return time, legs


def estimate_rate(time: Floats, path: Path) -> float:
    """Return the rate of samples [Hz], from the median of the steps between their times.

    Parameters
    ----------
    time
        Times [s], shape (n,).
    path
        The file that messages name.

    Raises
    ------
    GaitInputError
        Where the times do not increase.
    """
    steps = np.diff(time[np.isfinite(time)])
    step = float(np.median(steps)) if len(steps) else 0.0
    if not step > 0:
        raise GaitInputError(f"{path.name}: the times do not go on. Map another time column.")
    return round(1 / step, 1)


def read_mass(path: Path) -> float:
    """Return the body mass [kg] that moore2013 keeps in ``SubjectInfo.csv`` beside a recording.

    Raises
    ------
    GaitInputError
        Where there is no such file, or no mass in it.
    """
    beside = path.with_name("SubjectInfo.csv")
    if beside.is_file():
        with beside.open(newline="", encoding="utf-8-sig") as file:
            row: dict[str, Any] = next(csv.DictReader(file), {})
        try:
            return float(row["mass"])
        except (KeyError, ValueError):
            pass
    raise GaitInputError(
        f"The body mass of {path.name} is not known. Give it in kg: --mass 75. A2 is power by mass."
    )
