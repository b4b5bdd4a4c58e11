"""OpenSim's .mot, .sto and .trc files, and the ASCII exports of Visual3D and Nexus."""

from __future__ import annotations

import csv
import re
from itertools import islice, takewhile
from pathlib import Path

import numpy as np

from rehab.gait.recordings import csv_files
from rehab.gait.recordings.csv_files import open_text
from rehab.gait.recordings.table import RATE_MOST_HZ, Table, resample_channel
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

LINES_MAX = 5_000_000


def read_storage(path: Path) -> Table:
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
    table = _read_rows(path, names, (line.split() for line in lines[heads[0] + 2 :]))
    flags = "".join(lines[: heads[0]]).lower().replace(" ", "")
    angle = "°" if "indegrees=yes" in flags else "rad"
    for name in table:
        if re.search(r"_v[xyz]$|_force$", name):
            table.units[name] = "N"
        elif re.search(r"_moment$|torque", name):
            table.units[name] = "Nm"
        elif "_angle_" in name:
            table.units[name] = angle
    return table


def read_markers(path: Path) -> Table:
    """Return the columns of a .trc file: ``time``, and ``marker.X`` to ``marker.Z``."""
    lines = _read_lines(path)
    if not lines[3].lower().startswith("frame#"):
        raise GaitInputError(f"{path.name} is no marker file. Export it again.")
    markers = [name for name in lines[3].split("\t")[2:] if name.strip()]
    names = ["frame", "time", *(f"{m.strip()}.{axis}" for m in markers for axis in "XYZ")]
    return _read_rows(path, names, (line.split("\t") for line in lines[5:]))


def read_qualisys(path: Path) -> Table:
    """Return the columns of a .tsv of Qualisys: ``time``, and ``marker.X`` to ``marker.Z``.

    Lines of one word and its value come first; a table of samples follows, with the names of its
    columns above it or, of markers, in ``MARKER_NAMES``. A .tsv without such lines is a CSV.
    """
    lines = _read_lines(path)
    rows = [line.split("\t") for line in lines]
    begin = next((n for n, row in enumerate(rows) if _are_numbers(row)), len(rows))
    heads = {row[0].strip().upper(): row[1:] for row in rows[:begin] if row[0].strip()}
    if "FREQUENCY" not in heads:
        return csv_files.read_table(path)
    try:
        rate_hz = float(heads["FREQUENCY"][0])
        if not 0 < rate_hz < RATE_MOST_HZ:
            raise ValueError
    except (IndexError, ValueError):
        raise GaitInputError(f"{path.name} has no FREQUENCY in Hz. Export it again.") from None
    width = len([cell for cell in rows[begin] if cell.strip()]) if begin < len(rows) else 0
    markers = [name.strip() for name in heads.get("MARKER_NAMES", []) if name.strip()]
    if "MARKER_NAMES" in heads:
        names = [f"{marker}.{axis}" for marker in markers for axis in "XYZ"]
        first = [cell.strip() for cell in rows[begin - 1]]
        names = first[: width - len(names)] + names if len(first) == width else names
    else:
        names = [cell.strip() for cell in rows[begin - 1]] if begin else []
    if not names or len(names) > width:
        raise GaitInputError(f"{path.name} has no names over its columns. Export it with them.")
    table = _read_rows(path, names, rows[begin:])
    time = next((table[name] for name in table if name.lower() in {"time", "time_s"}), None)
    count = len(next(iter(table.values())))
    return Table({"time": np.arange(count) / rate_hz if time is None else time} | table)


def _are_numbers(row: list[str]) -> bool:
    cells = [cell for cell in row if cell.strip()]
    return len(cells) > 1 and not any(np.isnan(_read_number(cell)) for cell in cells)


def is_exported(path: Path) -> bool:
    """Return whether a text file is an export of Visual3D or Nexus, by its first lines."""
    head = _read_lines(path, 5)
    return head[4].startswith("ITEM") or head[0].strip().strip(",").lower() in {
        "devices", "model outputs", "trajectories", "joints"
    }  # fmt: skip


def read_export(path: Path) -> Table:
    """Return the columns of an ASCII export of Visual3D or Nexus, at its fastest rate.

    Raises
    ------
    GaitInputError
        With the cure, for a file of another form.
    """
    lines = _read_lines(path)
    return _read_visual3d(path, lines) if lines[4].startswith("ITEM") else _read_nexus(path, lines)


def _read_visual3d(path: Path, lines: list[str]) -> Table:
    """Five lines of heads: file, signal, type, folder, component; then rows by their number."""
    signals, components = lines[1].split("\t"), lines[4].split("\t")
    names = ["ITEM"] + [
        f"{signal.strip()}.{component.strip()}"
        for signal, component in zip(signals[1:], components[1:], strict=False)
    ]
    table = _read_rows(path, names, (line.split("\t") for line in lines[5:]))
    for name, values in table.items():
        if name.lower().startswith("time"):
            return Table({"time": values} | table)
    raise GaitInputError(
        f"{path.name} has no TIME signal. Add it to the export: rows are numbered, not timed."
    )


def _read_nexus(path: Path, lines: list[str]) -> Table:
    """Sections, each with its rate, names over columns, columns, units and rows."""
    found: list[tuple[float, Table]] = []
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
            if not 0 < rate_hz < RATE_MOST_HZ:
                raise ValueError
        except ValueError:
            raise GaitInputError(
                f"{path.name}: {head[0][:40]!r} below {title[:40]!r} is no rate. Export again."
            ) from None
        groups, labels, units = (next(csv.reader([line]), []) for line in head[1:4])
        names = _name_columns(groups, labels)
        table = _read_rows(path, names, csv.reader(rows))
        table.units = dict(zip(names, units, strict=False))
        found.append((rate_hz, table))
    if not found:
        raise GaitInputError(f"{path.name} has no section with samples. Export it again.")
    fastest_hz = max(rate for rate, _ in found)
    count = max(len(next(iter(t.values()))) for rate, t in found if rate == fastest_hz)
    time: Floats = np.arange(count) / fastest_hz
    columns = Table({"time": time})
    for rate_hz, table in found:
        columns.units |= table.units
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


def _read_lines(path: Path, most: int = LINES_MAX) -> list[str]:
    with open_text(path) as file:
        lines = [line.rstrip("\n") for line, _ in zip(file, range(most), strict=False)]
    return lines + [""] * (5 - len(lines))


def _read_rows(path: Path, names: list[str], rows: object) -> Table:
    table = [
        [_read_number(cell) for cell in row[: len(names)]]
        for row in rows  # type: ignore[attr-defined]
        if len(row) >= len(names)
    ]
    if not table:
        raise GaitInputError(f"{path.name} has a header but no samples. Export it again.")
    columns = np.array(table).T
    return Table({name: values for name, values in zip(names, columns, strict=True) if name})


def _read_number(cell: str) -> float:
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return float("nan")
