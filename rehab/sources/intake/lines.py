"""Lines of text as rows: JSON objects, or CSV with a header."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence

from rehab.sources.intake.rows import BadRow, Cell

MAX_LINE = 64 * 1024  # bytes
MAX_CELLS = 256


class LineReader:
    """Reads the lines of one sender.

    A line that begins with ``{`` is a JSON object. Any other is CSV (comma, semicolon or tab); one
    whose first cell is a name is a header for those that follow.

    Parameters
    ----------
    header
        Names of CSV cells until a header comes, for senders that send none.
    """

    def __init__(self, header: Sequence[str] = ()) -> None:
        self._names = tuple(header)
        self._partial = b""
        self._skips = False  # the rest of a line that was too long

    def read_bytes(self, data: bytes) -> tuple[list[Mapping[str, Cell]], list[str]]:
        """Return the rows of the lines that these bytes complete, and the problems of others."""
        rows: list[Mapping[str, Cell]] = []
        wrong: list[str] = []
        *lines, self._partial = (self._partial + data).split(b"\n")
        for line in lines:
            if self._skips:
                self._skips = False
                continue
            try:
                row = self.read_line(line.decode("utf-8"))
            except UnicodeDecodeError:
                wrong.append(f"{line[:20]!r} is no text. Send lines of CSV or JSON in UTF-8.")
            except BadRow as problem:
                wrong.append(str(problem))
            else:
                if row is not None:
                    rows.append(row)
        if len(self._partial) > MAX_LINE:
            if not self._skips:
                wrong.append(f"A line has more than {MAX_LINE} bytes. End each row with a newline.")
            self._partial, self._skips = b"", True
        return rows, wrong

    def read_line(self, line: str) -> Mapping[str, Cell] | None:
        """Return a line's row, None for a blank line or a header. Raises BadRow, with the cure."""
        line = line.strip().removeprefix("\ufeff")
        if not line:
            return None
        if len(line) > MAX_LINE:
            raise BadRow(f"A line has more than {MAX_LINE} bytes. Send one row in a line.")
        return _read_json(line) if line[0] in "{[" else self._read_csv(line)

    def _read_csv(self, line: str) -> Mapping[str, Cell] | None:
        delimiter = max(",;\t", key=line.count)
        try:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
        except csv.Error as problem:
            raise BadRow(f"{line[:40]!r} is no CSV ({problem}).") from None
        first = _read_cell(cells[0])
        is_header = isinstance(first, str) and not any(
            isinstance(_read_cell(cell), float) for cell in cells
        )
        if is_header and len(cells) > 1:
            if len(set(cells)) < len(cells) or len(cells) > MAX_CELLS:
                raise BadRow(
                    f"The header {line[:40]!r} names a column twice, or more than {MAX_CELLS}."
                )
            self._names = tuple(cells)
            return None
        if not self._names:
            raise BadRow(
                f"{line[:40]!r} came before any header. Send a first line such as "
                "time_s,side,value, or give the names with --header."
            )
        if len(cells) != len(self._names):
            raise BadRow(
                f"{line[:40]!r} has {len(cells)} cells, the header {len(self._names)}. Send as "
                "many; leave a cell blank where there is no number."
            )
        return {name: _read_cell(cell) for name, cell in zip(self._names, cells, strict=True)}


def _read_cell(text: str) -> Cell:
    if not text:
        return None
    try:
        return text if "_" in text else float(text)  # Python would read 1_000
    except ValueError:
        return text


def _read_json(line: str) -> Mapping[str, Cell]:
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        row = None
    if not isinstance(row, dict):
        raise BadRow(f"{line[:40]!r} is no JSON object. Send one in a line.")
    if len(row) > MAX_CELLS:
        raise BadRow(f"A row has {len(row)} cells. Send at most {MAX_CELLS}.")
    cells: dict[str, Cell] = {}
    for name, cell in row.items():
        if isinstance(cell, bool | int):
            cell = _as_float(cell)  # noqa: PLW2901
        if cell is not None and not isinstance(cell, float | str):
            raise BadRow(f"{name[:40]} holds a list or an object. Send one number in a cell.")
        cells[name] = cell
    return cells


def _as_float(number: int) -> float:
    try:
        return float(number)
    except OverflowError:
        return float("inf")
