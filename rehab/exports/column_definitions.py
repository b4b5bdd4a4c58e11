"""A table of an export: each column with its name, meaning, type, unit, and where it comes from.

CSV, Parquet, the codebook and the motion data of BIDS all follow from these columns.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from operator import attrgetter
from typing import Any

from django.utils.functional import Promise

from rehab.exports.selection import Selection
from rehab.sessions.models import TrainingSession


class Type(StrEnum):
    """What the cells of a column hold."""

    TEXT = "text"
    INTEGER = "integer"
    NUMBER = "number"
    BOOLEAN = "boolean"  # true or false
    TIME = "time"  # ISO 8601, UTC
    DATE = "date"  # ISO 8601
    JSON = "json"


Source = str | Callable[[Any], Any]
UNITS = {Type.TIME: "UTC", Type.JSON: "JSON"}  # of columns that name no other


@dataclass(frozen=True)
class Column:
    """One column.

    ``source``: where its cell comes from, as a path of attributes of the row (``step.value``) or a
    function of the row; without one, the attribute of its own name. ``is_channel``: it is a channel
    of the motion data, too (`research.bids`).
    """

    name: str
    meaning: str
    source: Source = ""
    type: Type = Type.TEXT
    unit: str = ""
    is_channel: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", self.unit or UNITS.get(self.type, ""))

    @classmethod
    def number(cls, name: str, unit: str, meaning: str, source: Source = "") -> Column:
        """Return a column of numbers with a unit."""
        return cls(name, meaning, source, Type.NUMBER, unit)

    @classmethod
    def integer(cls, name: str, meaning: str, source: Source = "", unit: str = "") -> Column:
        """Return a column of whole numbers."""
        return cls(name, meaning, source, Type.INTEGER, unit)

    @classmethod
    def flag(cls, name: str, meaning: str, source: Source = "") -> Column:
        """Return a column of true and false."""
        return cls(name, meaning, source, Type.BOOLEAN)

    @classmethod
    def time(cls, name: str, meaning: str, source: Source = "") -> Column:
        """Return a column of moments."""
        return cls(name, meaning, source, Type.TIME)

    @property
    def get(self) -> Callable[[Any], Any]:
        """What returns its cell of a row."""
        if callable(self.source):
            return self.source
        return attrgetter(self.source or self.name)


# The columns with which every table begins.
WHOSE = (
    Column("session", "Number of the session.", "pk", Type.INTEGER),
    Column("patient", "Pseudonym of the patient.", "patient.pseudonym"),
)


@dataclass(frozen=True)
class Table:
    """A CSV file: what it holds, and its columns.

    ``read_rows`` yields the rows of one session, from which columns get their cells. ``own``: the
    columns after `WHOSE`.
    """

    file: str
    title: str | Promise
    read_rows: Callable[[Selection, TrainingSession], Iterable[Any]]
    own: tuple[Column, ...]

    @property
    def columns(self) -> tuple[Column, ...]:
        """All columns, in the order of the file."""
        return (*WHOSE, *self.own)

    @property
    def header(self) -> list[str]:
        """The names of the columns."""
        return [column.name for column in self.columns]

    @cached_property
    def _cells(self) -> Any:
        return namedtuple("Cells", self.header)

    def read(self, selection: Selection) -> Iterator[Any]:
        """Yield the rows as named tuples of cells."""
        own = [column.get for column in self.own]
        for session in selection.read_sessions():
            whose = [column.get(session) for column in WHOSE]
            for row in self.read_rows(selection, session):
                yield self._cells._make(whose + [get(row) for get in own])
