"""Tables of recorded signals, whatever kind of file they are in."""

from __future__ import annotations

import csv
import gzip
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rehab.gait.recordings import c3d_files, csv_files, motion_files
from rehab.gait.recordings.column_mapping import (
    OVERGROUND,
    ColumnMap,
    find_layout,
    put_back_filtered,
    read_column_map,
)
from rehab.gait.recordings.csv_files import apply_columns
from rehab.gait.recordings.table import Table, join_tables
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import GaitInputError
from robot.plugins import Registry

# What parsers raise for files whose content does not match their ending.
DAMAGED = (
    ArithmeticError, AttributeError, EOFError, gzip.BadGzipFile, LookupError, MemoryError,
    RuntimeError, TypeError, ValueError, csv.Error, zlib.error,
)  # fmt: skip
LARGEST = 1e30  # of a sensor's values; a larger one is damage
BYTES_MAX = 512 * 1024 * 1024

Reader = Callable[[Path], Mapping[str, Floats]]


def _check_reader(name: str, part: object) -> None:
    if not callable(part):
        raise TypeError(f"{part!r} reads no file")
    if not name.isalnum() or name != name.lower():
        raise ValueError("a reader is named by the ending of its files, in small letters")


# Ending of a file: what returns its columns by name, shape (n,) each, with a column of times.
READERS: Registry[Reader] = Registry(
    "garry.readers",
    {
        "csv": csv_files.read_table,
        "c3d": c3d_files.read_table,
        "mot": motion_files.read_storage,
        "sto": motion_files.read_storage,
        "trc": motion_files.read_markers,
        "tsv": motion_files.read_qualisys,
    },
    _check_reader,
)


class RecordedSignals(NamedTuple):
    """A walk's signals in SI units, with our signs.

    Attributes
    ----------
    time_s, legs
        Times, shape (n,), and ``LegSamples`` of shape (n,) by side.
    frames
        The samples' numbers, shape (n,), None where no column has them.
    is_overground
        Whether the recording says that it is of steps over plates in a floor.
    """

    time_s: Floats
    legs: dict[str, LegSamples]
    frames: Floats | None
    is_overground: bool


def read_any_table(*paths: Path) -> Table:
    """Return the columns of a walk's files by name, shape (n,) each, at the fastest one's rate.

    The kind follows from the ending: CSV (also gzipped, and the ASCII of Visual3D and Nexus), C3D,
    OpenSim's .mot, .sto and .trc, Qualisys' .tsv. Several files are joined by their times, in a
    column ``time`` [s].

    Raises
    ------
    GaitInputError
        With the cure, for a file that is of no known kind, too large, or damaged.
    OSError
        For a file that cannot be read.
    """
    if len(paths) > 1:
        return join_tables({path.name: read_any_table(path) for path in paths})
    (path,) = paths
    if path.stat().st_size > BYTES_MAX:
        raise GaitInputError(
            f"{path.name} has more than {BYTES_MAX // 2**20} MiB. Export a minute of walking."
        )
    endings = [ending.lower()[1:] for ending in path.suffixes if ending.lower() != ".gz"]
    reader = READERS.get(endings[-1] if endings else "csv", csv_files.read_table)
    try:
        if reader is csv_files.read_table and motion_files.is_exported(path):
            reader = motion_files.read_export
        table = reader(path)
    except GaitInputError:
        raise
    except DAMAGED as problem:
        raise GaitInputError(f"{path.name} is damaged ({problem}). Export it again.") from None
    table = table if isinstance(table, Table) else Table(table)
    for name, values in table.items():
        table[name] = np.where(np.abs(values) < LARGEST, values, np.nan)
    return table


def read_signals(
    *paths: Path, pairs: Sequence[str] | None = None, filtered_hz: float | None = None
) -> RecordedSignals:
    """Return the signals of a recording.

    Parameters
    ----------
    paths
        The file, or those of one walk. A cell that is not a number is a missing sample: NaN.
    pairs
        Which column is which channel, as for ``read_column_map``; None to decide by the header.
    filtered_hz
        Cut-off of the causal low-pass that moments and angles have been through, if any.

    Raises
    ------
    GaitInputError
        With the cure, for columns that are missing or empty and for a file without samples.
    OSError
        For a file that cannot be read.
    """
    path, table = paths[0], read_any_table(*paths)
    columns = read_column_map(pairs) if pairs else find_layout(list(table))
    if filtered_hz is not None:
        columns = put_back_filtered(columns, filtered_hz)
    require_columns(path, table, columns)
    names = [column.name for column in columns.columns]
    frame = None if columns.frame is None else columns.frame.name  # an empty one is ignored
    empty = [name for name in names if name != frame and np.isnan(table[name]).all()]
    if empty:
        raise GaitInputError(f"{path.name}: column {', '.join(empty)} holds no numbers.")
    frames = None if frame is None else table[frame]
    return RecordedSignals(*apply_columns(table, columns), frames, says_overground(table))


def says_overground(table: Mapping[str, Floats]) -> bool:
    """Return whether a stored recording is one of steps over plates in a floor."""
    return OVERGROUND in table and bool((table[OVERGROUND] > 0).any())


def require_columns(path: Path, table: Mapping[str, Floats], columns: ColumnMap) -> None:
    """Raise GaitInputError, with the cure, where a file's table lacks a column of a map.

    Parameters
    ----------
    path
        The file, which the message names.
    table
        Its columns by name.
    columns
        The map.
    """
    missing = [column.name for column in columns.columns if column.name not in table]
    if missing:
        raise GaitInputError(
            f"{path.name} has no column {', '.join(missing)}. It has: {', '.join(table)}."
        )
