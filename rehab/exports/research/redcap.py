"""Sessions with their study visits as one table: for REDCap, and by `jamovi` for jamovi.

REDCap's data dictionary and import as its 18 columns and validations define them; the fields are
the columns of `SESSIONS` and `STUDY_VISITS`, whose codebook entries become labels and notes.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from rehab.exports.archive import write_csv
from rehab.exports.codebook import STUDY_VISITS
from rehab.exports.column_definitions import Column, Table, Type
from rehab.exports.session_table import SESSIONS

TABLES = (SESSIONS, STUDY_VISITS)
COLUMNS: tuple[Column, ...] = (*SESSIONS.columns, *STUDY_VISITS.own)
DICTIONARY = (
    *("Variable / Field Name", "Form Name", "Section Header", "Field Type", "Field Label"),
    *("Choices, Calculations, OR Slider Labels", "Field Note"),
    *("Text Validation Type OR Show Slider Number", "Text Validation Min", "Text Validation Max"),
    *("Identifier?", "Branching Logic (Show field only if...)", "Required Field?"),
    *("Custom Alignment", "Question Number (surveys only)", "Matrix Group Name"),
    *("Matrix Ranking?", "Field Annotation"),
)
VALIDATIONS = {
    Type.INTEGER: "integer",
    Type.NUMBER: "number",
    Type.TIME: "datetime_seconds_ymd",
    Type.DATE: "date_ymd",
}
FIELD_TYPES = {Type.BOOLEAN: "truefalse", Type.JSON: "notes"}  # of others: text
GUARD = re.compile(r"(?:^|(?<=[;\t\r\n]))'")  # what `format_cell` puts before a formula
Cells = list[Any]


def read_rows(parts: Iterable[Path]) -> Iterator[Cells]:
    """Yield the cells of `COLUMNS` of each session: numbers, booleans, moments, texts, None.

    ``parts``: the folders of the sessions, with their CSV files.
    """
    for part in parts:
        cells: Cells = []
        for table in TABLES:
            with (part / table.file).open(encoding="utf-8", newline="") as file:
                row = next(csv.reader(file), [""] * len(table.columns))
            typed = [_read(c, cell) for c, cell in zip(table.columns, row, strict=True)]
            cells += typed if not cells else typed[-len(table.own) :]
        yield cells


def _read(column: Column, cell: str) -> Any:
    if cell == "":
        return None
    if column.type is Type.INTEGER:
        return int(cell)
    if column.type is Type.NUMBER:
        return float(cell)
    if column.type is Type.BOOLEAN:
        return cell == "true"
    return datetime.fromisoformat(cell) if column.type is Type.TIME else GUARD.sub("", cell)


def redcap_files(rows: Iterable[Cells]) -> Iterator[tuple[str, Iterable[str]]]:
    """Yield the data dictionary, and the data to import under it. ``rows``: of `read_rows`."""
    fields = [_field(table, column) for table in TABLES for column in _own(table)]
    yield "redcap/dictionary.csv", write_csv(DICTIONARY, fields)
    cells = ([_write(cell) for cell in row] for row in rows)
    yield "redcap/data.csv", write_csv([column.name for column in COLUMNS], cells)


def _own(table: Table) -> tuple[Column, ...]:
    """Return a table's columns; what sessions have already is not asked again."""
    return table.columns if table is TABLES[0] else table.own


def _field(table: Table, column: Column) -> list[str]:
    said = {
        "Variable / Field Name": column.name,
        "Form Name": table.file.removesuffix(".csv"),
        "Field Type": FIELD_TYPES.get(column.type, "text"),
        "Field Label": column.meaning,
        "Field Note": column.unit,
        "Text Validation Type OR Show Slider Number": VALIDATIONS.get(column.type, ""),
    }
    return [said.get(name, "") for name in DICTIONARY]


def _write(cell: Any) -> Any:
    """Return a cell as REDCap imports it."""
    if isinstance(cell, bool):
        return int(cell)
    return f"{cell:%Y-%m-%d %H:%M:%S}" if isinstance(cell, datetime) else cell
