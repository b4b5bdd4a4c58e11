"""Recorded signals in CSV files: names of columns, then one row a sample."""

from __future__ import annotations

import csv
import gzip
import warnings
from codecs import BOM_UTF16_BE, BOM_UTF16_LE, getincrementaldecoder
from collections.abc import Collection, Iterable, Iterator, Mapping
from io import TextIOWrapper
from itertools import chain, islice
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TextIO, cast

import numpy as np

from rehab.gait.recordings.column_mapping import (
    CHANNELS,
    OVERGROUND,
    REQUIRED,
    SIGNAL_LAYOUTS,
    ColumnMap,
    SignalColumn,
)
from rehab.gait.recordings.inverse_dynamics import add_computed
from rehab.gait.recordings.table import Table
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import GaitInputError

MAX_HEADER = 64 * 1024
HEAD_LINES = 40  # above and below the names
AXES = {"", "X", "Y", "Z", "x", "y", "z"}


def open_text(path: Path) -> TextIO:
    """Open a text file, gzipped or not, in the encoding that its bytes tell.

    Raises
    ------
    GaitInputError
        For a file that is not text.
    """
    with _open_bytes(path) as file:
        encoding = find_encoding(file)
    if encoding is None:
        raise GaitInputError(f"{path.name} is no text. Save it as CSV UTF-8.")
    return TextIOWrapper(_open_bytes(path), encoding=encoding, errors="replace", newline="")


def _open_bytes(path: Path) -> BinaryIO:
    opened: Any = gzip.open(path) if path.suffix == ".gz" else path.open("rb")  # noqa: SIM115  # the caller closes it
    return cast(BinaryIO, opened)


def find_encoding(file: BinaryIO) -> str | None:
    """Return the encoding of a text: UTF-8, UTF-16 or, of all others, Windows-1252 (Latin-1).

    None for what is not text: it has zeros, and not those of UTF-16, where every other byte of
    numbers and names is one.
    """
    head = file.read(MAX_HEADER)
    if head.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        found = "utf-16-le" if head.startswith(BOM_UTF16_LE) else "utf-16-be"
        return "utf-16" if _is_utf_16(head[2:], found) else None
    if b"\0" in head:
        return next((one for one in ("utf-16-le", "utf-16-be") if _is_utf_16(head, one)), None)
    decoder, part = getincrementaldecoder("utf-8")(), head
    try:
        while part:
            decoder.decode(part)
            part = file.read(MAX_HEADER)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _is_utf_16(head: bytes, encoding: str) -> bool:
    """Return whether most letters of a text are of the Latin alphabet, as those of labs are."""
    text = head[: len(head) // 2 * 2].decode(encoding, errors="replace")
    letters = "".join(text.split())
    latin = sum(letter.isprintable() and letter < "\u0250" for letter in letters)
    return "\0" not in letters and latin > 0.8 * len(letters)


class Head(NamedTuple):
    """What stands above the samples: names and units of columns, their delimiter, how many lines.

    A ``delimiter`` of None is blanks.
    """

    names: list[str]
    units: list[str]
    delimiter: str | None
    lines: int


def read_head(path: Path) -> Head:
    """Return what stands above a file's samples.

    The names are in the first line of words that has as many cells as the lines below it; what
    stands above is passed over, a line of units below is read. Names that stand over several
    columns are joined with the axes in the line below them: ``LAnkleMoment.X``.

    Raises
    ------
    GaitInputError
        For a file that is not text.
    OSError
        For a file that cannot be read.
    """
    with open_text(path) as file:
        lines = [file.readline(MAX_HEADER) for _ in range(HEAD_LINES)]
    for at, line in enumerate(lines):
        delimiter = _find_delimiter(line)
        names = _split(line, delimiter)
        below = [_split(one, delimiter) for one in lines[at + 1 : at + 4] if one.strip()]
        is_table = bool(below) and all(len(row) == len(names) for row in below)
        if is_table and len(names) > 1 and 2 * sum(map(_is_word, names)) > len(names):
            break
    else:
        at, delimiter = 0, _find_delimiter(lines[0])
        names, below = _split(lines[0], delimiter), []
    words = []
    for row in below:
        if not any(map(_is_word, row)) or any(cell and not _is_word(cell) for cell in row):
            break
        words.append(row)
    count = at + 1 + len(words)
    over = _split(lines[at - 1], delimiter) if at else []
    if len(over) > 1 and set(names[1:]) <= AXES:
        names = _join_names(over + [""] * (len(names) - len(over)), names)
    elif words and (len(set(names)) < len(names) or set(words[0][1:]) <= AXES):
        names = _join_names(names, words.pop(0))
    return Head(names, words[0] if words else [], delimiter, count)


def _join_names(names: list[str], axes: list[str]) -> list[str]:
    """Return names with what stands below them; a blank one is that before it."""
    joined, name = [], ""
    for over, axis in zip(names, axes, strict=False):
        name = over or name
        joined.append(f"{name}.{axis}" if name and axis else name or axis)
    return joined


def _find_delimiter(line: str) -> str | None:
    delimiter = max(",;\t|", key=line.count)
    return delimiter if delimiter in line or len(line.split()) < 2 else None


def _split(line: str, delimiter: str | None) -> list[str]:
    cells = line.split() if delimiter is None else next(csv.reader([line], delimiter=delimiter), [])
    return [cell.strip() for cell in cells]


def _is_word(cell: str) -> bool:
    """Return whether a cell is neither empty nor a number."""
    try:
        float(cell.replace(",", ".") or "nan")
    except ValueError:
        return True
    return False


def read_table(path: Path) -> Table:
    """Return the columns of a CSV file by name, shape (n,) each; blank cells and text are NaN.

    Raises
    ------
    GaitInputError
        With the cure, for a file without names or samples.
    OSError
        For a file that cannot be read.
    """
    head = read_head(path)
    if not any(head.names):
        raise GaitInputError(f"{path.name} is empty. Export it again.")
    with open_text(path) as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of rows that are too short, which are left out
        rows = np.genfromtxt(
            _prepare(islice(file, head.lines, None), head.delimiter),
            delimiter=head.delimiter,
            usecols=range(len(head.names)),
            invalid_raise=False,
            ndmin=2,
        )
    if not rows.shape[0]:
        raise GaitInputError(f"{path.name} has a header but no samples. Export it again.")
    names = [
        name if name not in head.names[:at] else f"{name} ({at + 1})"
        for at, name in enumerate(head.names)
    ]
    return Table(dict(zip(names, rows.T, strict=True)), dict(zip(names, head.units, strict=False)))


def _prepare(lines: Iterator[str], delimiter: str | None) -> Iterable[str]:
    """Return lines of numbers without quotation marks and with decimal points.

    Between semicolons or tabs a comma is a decimal one, as in half of Europe; so it is in quotes.
    """
    first = next(lines, "")
    rest = chain([first], lines)
    if '"' in first and delimiter is not None:
        cells = csv.reader(rest, delimiter=delimiter)
        return (delimiter.join(cell.replace(",", ".") for cell in row) for row in cells)
    return rest if delimiter == "," else (line.replace(",", ".") for line in rest)


def apply_columns(
    table: Mapping[str, Floats], columns: ColumnMap
) -> tuple[Floats, dict[str, LegSamples]]:
    """Return times [s] and each leg's channels, in SI units, with our signs, delays removed.

    Parameters
    ----------
    table
        Columns by name, shape (n,) each.
    columns
        Which is which; all are there.
    """
    time: Floats = table[columns.time.name] * columns.time.factor

    def read(column: SignalColumn | None) -> Floats | None:
        if column is None:
            return None
        values: Floats = table[column.name] * column.factor
        if not column.delay_s:
            return values
        shifted: Floats = np.interp(time + column.delay_s, time, values)
        return shifted

    legs = {}
    for side, leg in columns.legs.items():
        values = {channel: np.asarray(read(column)) for channel, column in leg.items()}
        add_computed(values)
        force, moment, angle = (values[channel] for channel in REQUIRED)
        further = (values.get(channel) for channel in CHANNELS[3:])
        legs[side] = LegSamples(force, moment, angle, *further)
    return time, legs


def write_rows(file: TextIO, rows: Floats, counts: Collection[int] = ()) -> None:
    """Write samples as lines of a CSV file.

    Times and counts have all their digits: stamps may be seconds since 1970, counts 32 bits wide.

    Parameters
    ----------
    file
        A text file, open for writing, behind its header.
    rows
        The samples, shape (n, columns); their times come first.
    counts
        Which columns, from 0, are counts.
    """
    digits = (15 if place == 0 or place in counts else 9 for place in range(rows.shape[1]))
    np.savetxt(file, rows, [f"%.{most}g" for most in digits], ",")


def save_signals(
    path: Path,
    time_s: Floats,
    legs: Mapping[str, LegSamples],
    frames: Floats | None = None,
    *,
    is_overground: bool = False,
) -> None:
    """Write signals in SI units to a new CSV file, in the layout ``garry``.

    Parameters
    ----------
    path
        The file, which does not exist yet.
    time_s
        Times [s], shape (n,).
    legs
        The channels of each leg by its side ("left", "right"), shape (n,) each.
    frames
        The samples' numbers, shape (n,), if there are any.

    Raises
    ------
    GaitInputError
        Where there is such a file already.
    OSError
        Where it cannot be written.
    """
    layout = SIGNAL_LAYOUTS["garry"]
    columns = {layout.time.name: time_s}
    for side, leg in legs.items():
        for channel, values in zip(CHANNELS, leg, strict=True):
            if values is not None:
                columns[layout.legs[side][channel].name] = np.asarray(values)
    counts = set()
    if layout.frame is not None and frames is not None:
        counts = {len(columns)}
        columns[layout.frame.name] = frames
    if is_overground:
        columns[OVERGROUND] = np.ones(len(time_s))
    rows = np.column_stack(list(columns.values()))
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(",".join(columns) + "\n")
            write_rows(file, rows, counts)
    except FileExistsError:
        raise GaitInputError(
            f"There is a recording {path.name} already. Choose another name."
        ) from None


def read_mass(path: Path) -> float:
    """Return the body mass [kg] that moore2013 stores in ``SubjectInfo.csv`` beside a recording.

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
