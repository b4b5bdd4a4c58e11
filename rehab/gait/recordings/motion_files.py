"""OpenSim's .mot, .sto and .trc files, and the ASCII exports of Visual3D and Nexus."""

from __future__ import annotations

import csv
from itertools import islice, takewhile
from pathlib import Path

import numpy as np

from rehab.gait.recordings.csv_files import open_text
from rehab.gait.recordings.rates import resample_channel
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

LINES_MAX = 5_000_000


def read_storage(path: Path) -> dict[str, Floats]:
    """Return the columns of a .mot or .sto file: names follow ``endheader``.

    Raises
    ------
    GaitInputError
        With the cure, for a file of another form.
    """
    lines = _read_lines(path)
    heads = [n for n, line in enumerate(lines[:200]) if line.strip().lower() == "endheader"]
    if not heads or len(lines) < heads[0] + 3:
        raise GaitInputError(f"{path.name} has no endheader and samples. Export it again.")
    names = lines[heads[0] + 1].split()
    return _read_rows(path, names, (line.split() for line in lines[heads[0] + 2 :]))


def read_markers(path: Path) -> dict[str, Floats]:
    """Return the columns of a .trc file: ``time``, and ``marker.X`` to ``marker.Z``."""
    lines = _read_lines(path)
    if len(lines) < 7 or not lines[3].lower().startswith("frame#"):
        raise GaitInputError(f"{path.name} is no marker file. Export it again.")
    markers = [name for name in lines[3].split("\t")[2:] if name.strip()]
    names = ["frame", "time", *(f"{m.strip()}.{axis}" for m in markers for axis in "XYZ")]
    return _read_rows(path, names, (line.split("\t") for line in lines[5:]))


def is_exported(path: Path) -> bool:
    """Return whether a text file is an export of Visual3D or Nexus, by its first lines."""
    with open_text(path) as file:
        head = [file.readline(65536) for _ in range(5)]
    return head[4].startswith("ITEM") or head[0].strip().strip(",").lower() in {
        "devices", "model outputs", "trajectories", "joints"
    }  # fmt: skip


def read_export(path: Path) -> dict[str, Floats]:
    """Return the columns of an ASCII export of Visual3D or Nexus, at its fastest rate.

    Raises
    ------
    GaitInputError
        With the cure, for a file of another form.
    """
    lines = _read_lines(path)
    return _read_visual3d(path, lines) if lines[4].startswith("ITEM") else _read_nexus(path, lines)


def _read_visual3d(path: Path, lines: list[str]) -> dict[str, Floats]:
    """Five lines of heads: file, signal, type, folder, component; then rows by their number."""
    signals, components = lines[1].split("\t"), lines[4].split("\t")
    names = ["ITEM"] + [
        f"{signal.strip()}.{component.strip()}"
        for signal, component in zip(signals[1:], components[1:], strict=False)
    ]
    table = _read_rows(path, names, (line.split("\t") for line in lines[5:]))
    for name, values in table.items():
        if name.lower().startswith("time"):
            return {"time": values} | table
    raise GaitInputError(
        f"{path.name} has no TIME signal. Add it to the export: rows are numbered, not timed."
    )


def _read_nexus(path: Path, lines: list[str]) -> dict[str, Floats]:
    """Sections, each with its rate, names over columns, columns, units and rows."""
    found: list[tuple[float, dict[str, Floats]]] = []
    rest = iter(lines)
    for title in rest:
        if not _has_cells(title):
            continue
        head = list(islice(rest, 4))  # rate, names over columns, columns, units
        rows = list(takewhile(_has_cells, rest))
        if not rows:
            break
        try:
            rate_hz = float(head[0].split(",")[0])
        except ValueError:
            raise GaitInputError(
                f"{path.name}: {head[0][:40]!r} below {title[:40]!r} is no rate. Export again."
            ) from None
        names = _name_columns(*(next(csv.reader([line])) for line in head[1:3]))
        found.append((rate_hz, _read_rows(path, names, csv.reader(rows))))
    if not found:
        raise GaitInputError(f"{path.name} has no section with samples. Export it again.")
    fastest_hz = max(rate for rate, _ in found)
    count = max(len(next(iter(t.values()))) for rate, t in found if rate == fastest_hz)
    time: Floats = np.arange(count) / fastest_hz
    columns = {"time": time}
    for rate_hz, table in found:
        for name, values in table.items():
            if name not in {"Frame", "Sub Frame"}:
                columns[name] = resample_channel(values, rate_hz, time)
    return columns


def _has_cells(line: str) -> bool:
    return bool(line.strip(" ,\t\r"))


def _name_columns(groups: list[str], names: list[str]) -> list[str]:
    """Return names with those over them, which stand above the first of their columns."""
    labels, group = [], ""
    for place, name in enumerate(names):
        over = groups[place].strip() if place < len(groups) else ""
        group = over.rpartition(":")[2] or group
        labels.append(f"{group}.{name.strip()}" if place > 1 else name.strip())
    return labels


def _read_lines(path: Path) -> list[str]:
    try:
        with open_text(path) as file:
            lines = [line.rstrip("\n") for line, _ in zip(file, range(LINES_MAX), strict=False)]
    except UnicodeDecodeError:
        raise GaitInputError(f"{path.name} is no text. Export it as text.") from None
    return lines + [""] * (5 - len(lines))


def _read_rows(path: Path, names: list[str], rows: object) -> dict[str, Floats]:
    table = [
        [_read_number(cell) for cell in row[: len(names)]]
        for row in rows  # type: ignore[attr-defined]
        if len(row) >= len(names)
    ]
    if not table:
        raise GaitInputError(f"{path.name} has a header but no samples. Export it again.")
    columns = np.array(table).T
    return {name: values for name, values in zip(names, columns, strict=True) if name}


def _read_number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")
