"""A table of text whose cells can be read as numbers, with errors that name their place."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_INFINITE = re.compile(r"[+-]?inf(?:inity)?", re.IGNORECASE)
_MISSING = frozenset({"", "nan", "-nan"})  # MATLAB writes a missing number as NaN
_FLAGS = {"1": True, "1.0": True, "true": True, "0": False, "0.0": False, "false": False}
_LARGEST_WHOLE = 2**53  # floats above do not have every whole number


class RecordingError(ValueError):
    """A recording that cannot be used; the message names the place and the cure."""


def quote(text: str) -> str:
    """Return a cell's text for a message: in quotation marks, escaped and short."""
    return repr(text if len(text) <= 40 else f"{text[:39]}…")


@dataclass(frozen=True, slots=True)
class RecordedTable:
    """A file's columns (name → place), its rows, and the mark its decimals are written with."""

    name: str
    columns: dict[str, int]
    cells: tuple[list[str], ...]
    decimal_mark: str

    @property
    def rows(self) -> list[Row]:
        """The rows below the header, numbered as a spreadsheet numbers them."""
        return [Row(self, number, cells) for number, cells in enumerate(self.cells, start=2)]


@dataclass(frozen=True, slots=True)
class Row:
    """One row. A column that the file does not have reads as blank."""

    table: RecordedTable
    number: int
    cells: list[str]

    def error(self, problem: str, column: str = "") -> RecordingError:
        """Return the error that names this row, and the column if one is to blame."""
        place = f"Row {self.number} of recording {self.table.name}"
        return RecordingError(
            f"{place}, column {column}: {problem}" if column else f"{place}: {problem}"
        )

    def has(self, column: str) -> bool:
        """Return whether the file has this column."""
        return column in self.table.columns

    def text(self, column: str) -> str:
        """Return a cell's text without surrounding blanks."""
        place = self.table.columns.get(column)
        return "" if place is None else self.cells[place]

    def number_in(self, column: str) -> float | None:
        """Return a cell's number: None where it is blank or NaN; infinities are passed on.

        Raises RecordingError for text.
        """
        text = self.text(column)
        if text.lower() in _MISSING:
            return None
        plain = text
        if self.table.decimal_mark == ",":
            # In such a file a point can only group thousands: "1.234" would be read wrongly.
            plain = text.replace(".", "?").replace(",", ".")
        if not (_NUMBER.fullmatch(plain) or _INFINITE.fullmatch(plain)):
            comma = self.table.decimal_mark == ","
            marks = ", with a decimal comma as elsewhere in this file" if comma else ""
            raise self.error(
                f"{quote(text)} is not a number. Write one{marks}, or leave the cell blank.", column
            )
        return float(plain)

    def finite_in(self, column: str) -> float:
        """Return a cell's number. Raises RecordingError where it is missing or not finite."""
        number = self.number_in(column)
        if number is None or not math.isfinite(number):
            raise self.error(f"{quote(self.text(column))} is no finite number. Write one.", column)
        return number

    def whole_in(self, column: str) -> int:
        """Return a cell's whole number. Raises RecordingError for anything else."""
        number = self.finite_in(column)
        if not number.is_integer() or abs(number) > _LARGEST_WHOLE:
            raise self.error(f"{quote(self.text(column))} is no whole number. Write one.", column)
        return int(number)

    def flag_in(self, column: str) -> bool | None:
        """Return a cell's yes (1, true) or no (0, false), None where it is blank or NaN.

        Raises RecordingError for anything else.
        """
        text = self.text(column).lower()
        if text in _MISSING:
            return None
        if text not in _FLAGS:
            raise self.error(
                f"{quote(text)} is neither 1 nor 0. Write 1 for yes, 0 for no.", column
            )
        return _FLAGS[text]
