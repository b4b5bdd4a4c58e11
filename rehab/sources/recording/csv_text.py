"""The bytes of a CSV file as a table."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from itertools import islice

from rehab.sources.recording.table import RecordedTable, RecordingError, Row, quote

MAX_ROWS = 200_000  # walking all day takes 80,000 strides of a leg
MAX_CELL_CHARACTERS = 200

# Comma first: it wins where a header of one column decides nothing. Tabs are what spreadsheets
# write as UTF-16 text, semicolons what they write where the comma is the decimal mark.
_DELIMITERS = ",;\t"
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_SAVE_AGAIN = 'Open it in a spreadsheet and save it as "CSV UTF-8".'


def parse_table(data: bytes, name: str) -> RecordedTable:
    """Return the table in a file's bytes. Raises RecordingError for anything but a clean one.

    Accepted are UTF-8 and, with a byte order mark, UTF-16; commas, semicolons or tabs between
    cells; any line ends; decimal commas where commas do not separate cells.
    """
    text = _decode(data, name)
    first_line = re.match(r"[^\r\n]*", text)
    delimiter = max(_DELIMITERS, key=(first_line.group() if first_line else "").count)
    lines = _split(text, delimiter, name)
    if not lines:
        raise RecordingError(f"Recording {name} is empty. Export it again.")
    header, *cells = lines
    columns = _check_header(header, name)
    if not cells:
        raise RecordingError(f"Recording {name} has a header but no strides. Export it again.")
    decimal_comma = delimiter != "," and any(
        _DECIMAL_COMMA.fullmatch(cell) for row in cells for cell in row
    )
    table = RecordedTable(name, columns, tuple(cells), "," if decimal_comma else ".")
    for row in table.rows:
        _check_row(row)
    return table


def _decode(data: bytes, name: str) -> str:
    marks = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    encoding = "UTF-16" if data.startswith(marks) else "UTF-8"
    try:
        text = data.decode(encoding).removeprefix("\ufeff")
    except UnicodeDecodeError as problem:
        raise RecordingError(
            f"Recording {name} is no {encoding} text: byte {problem.start + 1} cannot be read. "
            f"{_SAVE_AGAIN}"
        ) from None
    if "\0" in text:
        raise RecordingError(f"Recording {name} holds NUL bytes and is no CSV text. {_SAVE_AGAIN}")
    return text


def _split(text: str, delimiter: str, name: str) -> list[list[str]]:
    """Return all rows up to the last one that is not blank."""
    rows: list[list[str]] = []
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    try:
        rows.extend([cell.strip() for cell in cells] for cells in islice(reader, MAX_ROWS + 1))
    except csv.Error as problem:
        raise RecordingError(
            f"Row {len(rows) + 1} of recording {name} cannot be read ({problem}). "
            "Close every quotation mark that is opened, and double those within a cell."
        ) from None
    if len(rows) > MAX_ROWS:
        raise RecordingError(
            f"Recording {name} has more than {MAX_ROWS} rows. Split it into sessions."
        )
    while rows and not any(rows[-1]):
        rows.pop()
    return rows


def _check_header(header: list[str], name: str) -> dict[str, int]:
    """Return the place of every column. Raises RecordingError for blank and repeated names."""
    if not any(header):
        raise RecordingError(f"Row 1 of recording {name} is blank. Put the column names there.")
    for place, column in enumerate(header, start=1):
        if not column:
            raise RecordingError(
                f"Column {place} of recording {name} has no name in row 1. Name it or delete it."
            )
        if len(column) > MAX_CELL_CHARACTERS:
            raise RecordingError(
                f"Column {place} of recording {name} has a name of {len(column)} characters. "
                f"Give it one of at most {MAX_CELL_CHARACTERS}."
            )
    column, count = Counter(header).most_common(1)[0]
    if count > 1:
        raise RecordingError(
            f"Recording {name} has {count} columns named {quote(column)}. Keep one of them."
        )
    return {column: place for place, column in enumerate(header)}


def _check_row(row: Row) -> None:
    if not any(row.cells):
        raise row.error("the row is blank. Delete it; only the file's end may be blank.")
    expected = len(row.table.columns)
    if len(row.cells) != expected:
        raise row.error(
            f"{len(row.cells)} cells where the header has {expected}. Give every row as many; put "
            "quotation marks around a cell that holds a comma, and semicolons between cells where "
            "numbers have decimal commas."
        )
    for column, cell in zip(row.table.columns, row.cells, strict=True):
        if len(cell) > MAX_CELL_CHARACTERS:
            raise row.error(
                f"a cell of {len(cell)} characters. Write at most {MAX_CELL_CHARACTERS}.",
                quote(column),
            )
