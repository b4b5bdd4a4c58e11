"""Tables as CSV for spreadsheets: numbers exactly, and no text that could be a formula.

Every CSV file that GARRY gives out is written here (tests/exports/test_patient_data.py).
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable, Sequence
from datetime import date
from typing import Any, Protocol

# Where a cell may begin for a spreadsheet, before what begins a formula (also in East Asian width).
FORMULA_START = re.compile(r"(?:^|(?<=[;\t\r\n]))(?=[=+\-@＝＋－＠\t\r\n'])")


def format_cell(value: Any) -> Any:
    """Return a value as it is written to a file: floats exactly, text never as a formula.

    A text that a spreadsheet could take for a formula gets a ' before it, at its beginning and,
    since some split lines there, behind each semicolon, tab and line end; so does a '. Taking these
    off gives back the original.
    """
    if value is None or (isinstance(value, (int, float)) and not isinstance(value, bool)):
        return value  # csv writes a float by repr: read back, it is the same
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, date):  # or a moment
        return value.isoformat()
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return FORMULA_START.sub("'", text)


class Writable(Protocol):
    """A file of text, or a response."""

    def write(self, text: str, /) -> object: ...


class CsvWriter:
    """Writes rows to a file."""

    def __init__(self, file: Writable) -> None:
        self._writer = csv.writer(file, lineterminator="\r\n")  # so each \r in a cell is quoted

    def write(self, rows: Iterable[Sequence[Any]]) -> None:
        """Write rows, each value as `format_cell` returns it."""
        self._writer.writerows([format_cell(value) for value in row] for row in rows)
