"""Where the rows of one session's tables go, some hundred at a time: CSV and Parquet."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar, Protocol

from rehab.exports.column_definitions import Table, Type
from rehab.people.web.csv_tables import CsvWriter
from robot.plugins import Registry, check_class

BATCH_ROWS = 1000  # held in memory
Rows = list[Any]  # as `Table.read` yields them


class Sink(Protocol):
    """Takes the rows of a table, in their order."""

    def write(self, rows: Rows) -> None:
        """Take some rows."""

    def close(self) -> None:
        """Finish what was written."""


def pump(rows: Iterable[Any], sinks: Sequence[Sink]) -> None:
    """Write rows to every sink, and finish them."""
    remaining = iter(rows)
    with ExitStack() as closing:  # every file, also where a row cannot be written
        for sink in reversed(sinks):
            closing.callback(sink.close)
        while batch := list(islice(remaining, BATCH_ROWS)):
            for sink in sinks:
                sink.write(batch)


class CsvSink:
    """A table's rows as CSV without the header, which the whole file has once."""

    def __init__(self, file: Path) -> None:
        self._file = file.open("w", encoding="utf-8", newline="")
        self._writer = CsvWriter(self._file)

    def write(self, rows: Rows) -> None:
        """Write some rows."""
        self._writer.write(rows)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class TableSink(Sink):
    """Writes a table's rows into a file of its own: a format of the export for analysis.

    ``ending``: of its files.
    """

    ending: ClassVar[str]

    @abstractmethod
    def __init__(self, file: Path, table: Table) -> None:
        """Begin a file for a table."""

    @staticmethod
    def is_available() -> bool:
        """Return whether the libraries that it needs are installed."""
        return True


class ParquetSink(TableSink):
    """A table's rows as Parquet: types by the codebook, text and numbers as they are stored.

    Each column's unit and meaning stand in its metadata.
    """

    ending = "parquet"

    @staticmethod
    def is_available() -> bool:
        """Return whether the library that writes Parquet is installed."""
        return find_spec("pyarrow") is not None

    def __init__(self, file: Path, table: Table) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        types = {
            Type.TEXT: pa.string(),
            Type.INTEGER: pa.int64(),
            Type.NUMBER: pa.float64(),
            Type.BOOLEAN: pa.bool_(),
            Type.TIME: pa.timestamp("us", tz="UTC"),
            Type.DATE: pa.date32(),
            Type.JSON: pa.string(),
        }
        self._arrow = pa
        self._json = [column.type is Type.JSON for column in table.columns]
        self._schema = pa.schema(
            [
                pa.field(
                    column.name,
                    types[column.type],
                    metadata={"unit": column.unit, "meaning": column.meaning},
                )
                for column in table.columns
            ]
        )
        self._writer = parquet.ParquetWriter(file, self._schema)

    def write(self, rows: Rows) -> None:
        """Write some rows as one group."""
        columns = [
            [_to_text(cell) if is_json else cell for cell in cells]
            for cells, is_json in zip(zip(*rows, strict=True), self._json, strict=True)
        ]
        arrays = [
            self._arrow.array(cells, type=field.type)
            for cells, field in zip(columns, self._schema, strict=True)
        ]
        self._writer.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))

    def close(self) -> None:
        """Write the end of the file."""
        self._writer.close()


# Name, and folder of the export: the format, of strides and of what patients saw.
FORMATS: Registry[type[TableSink]] = Registry(
    "garry.exports", {"parquet": ParquetSink}, check_class(TableSink)
)


def available_formats() -> dict[str, type[TableSink]]:
    """Return the formats that can be written here, by name."""
    return {name: one for name, one in FORMATS.items() if one.is_available()}


def _to_text(cell: Any) -> str | None:
    return None if cell is None else json.dumps(cell, ensure_ascii=False)
