"""A table as jamovi opens it: an .omv file.

Source: jamovi's own reader (its module ``formatio.omv``) and jmvReadWrite's write_omv (archive
version 11.0, which later ones read): a ZIP; data.bin has one column after the other, little-endian,
texts as numbers of the labels in xdata.json.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from struct import pack
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from rehab.exports.column_definitions import Column, Type

META = (
    "Manifest-Version: 1.0\nData-Archive-Version: 1.0.2\njamovi-Archive-Version: 11.0\n"
    "Created-By: GARRY\n"
)
INDEX = '<!DOCTYPE html><html><head><meta charset="utf-8"><title>Results</title></head></html>\n'
MISSING = -(2**31)  # of whole numbers; of others NaN


def write_omv(columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> bytes:
    """Return a table as the bytes of an .omv file.

    Parameters
    ----------
    columns, rows
        The columns, and the cells of each row as `redcap.read_rows` yields them.
    """
    fields, labels, data = [], {}, io.BytesIO()
    for number, column in enumerate(columns):
        cells = [row[number] for row in rows]
        kind, levels = _describe(column, cells)
        if levels is not None:
            labels[column.name] = {
                "labels": [[place, one, one, False] for place, one in enumerate(levels)]
            }
            cells = [None if cell is None else levels.index(_text(cell)) for cell in cells]
        if kind["type"] == "number":
            data.write(b"".join(pack("<d", float("nan" if c is None else c)) for c in cells))
        else:
            data.write(b"".join(pack("<i", MISSING if c is None else c) for c in cells))
        about = f"{column.meaning} [{column.unit}]" if column.unit else column.meaning
        fields.append(
            {"name": column.name, "id": number + 1, "columnType": "Data", **kind}
            | {"importName": column.name, "description": about, "width": 100}
            | {"formula": "", "formulaMessage": "", "parentId": 0, "transform": 0}
            | {"edits": [], "missingValues": [], **({} if levels is None else {"trimLevels": True})}
        )
    about_rows = {"rowCount": len(rows), "columnCount": len(fields), "fields": fields}
    more: dict[str, Any] = {"removedRows": [], "addedRows": [], "transforms": [], "weights": None}
    files: dict[str, str | bytes] = {
        "meta": META,
        "index.html": INDEX,
        "metadata.json": json.dumps({"dataSet": about_rows | more}),
        "xdata.json": json.dumps(labels),
        "data.bin": data.getvalue(),
    }
    file = io.BytesIO()
    with ZipFile(file, "w", ZIP_DEFLATED) as archive:
        for name, content in files.items():  # without the moment, for the same bytes again
            archive.writestr(ZipInfo(name), content, ZIP_DEFLATED)
    return file.getvalue()


def _describe(column: Column, cells: Sequence[Any]) -> tuple[dict[str, str], list[str] | None]:
    """Return how jamovi stores a column, and the labels of one that is no number."""
    if column.type is Type.NUMBER:
        return {"dataType": "Decimal", "measureType": "Continuous", "type": "number"}, None
    if column.type is Type.INTEGER:
        if all(cell is None or abs(cell) < -MISSING for cell in cells):
            return {"dataType": "Integer", "measureType": "Continuous", "type": "integer"}, None
        return {"dataType": "Decimal", "measureType": "Continuous", "type": "number"}, None
    levels = sorted({_text(cell) for cell in cells if cell is not None})
    return {"dataType": "Text", "measureType": "Nominal", "type": "integer"}, levels


def _text(cell: Any) -> str:
    return str(cell).lower() if isinstance(cell, bool) else str(cell)
