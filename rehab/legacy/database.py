"""Reading the original GARRY's database (`data.db`), which is validated and never written to.

Its columns are typed INTEGER but hold text and decimals as the app sent them
(docs/reference/original.md#database): numbers as text, a duration as 0:01:22.5, the start as a date
with a time.
"""

from __future__ import annotations

import math
import re
import sqlite3
from contextlib import closing
from dataclasses import dataclass, field
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rehab.training.valences import VALENCES

PARTICIPANTS = ("participant_id", "name")
SESSIONS = (
    "session_id",
    "participant_id",
    "year",
    "month",
    "day",
    "start_time",
    "duration",
    "score",
    "feedback_type",
    "threshold",
)
YEARS = range(1970, 2100)
MAX_DURATION_S = 24 * 3600.0
MAX_SCORE = 1e9


class InvalidDatabase(ValueError):
    """A file that is no complete database of the original GARRY; the message says why."""


class InvalidRow(ValueError):
    """A row that cannot be parsed; the message says why."""


@dataclass(frozen=True, slots=True)
class LegacySession:
    """A session of the original. ``row`` is its stored row; ``start`` is in local time."""

    id: int
    participant: int
    start: datetime
    duration_s: float
    score: float | None
    valence: str
    goal: float
    row: dict[str, Any]


@dataclass(slots=True)
class LegacyDatabase:
    """The contents of a file.

    ``session_errors`` and ``participant_errors`` say why rows cannot be parsed, by their ids or
    places. ``name_count`` is the number of participants with a name; no name is kept.
    """

    participants: list[int]
    name_count: int
    sessions: list[LegacySession] = field(default_factory=list)
    session_errors: dict[int | str, str] = field(default_factory=dict)
    participant_errors: dict[int | str, str] = field(default_factory=dict)


def read_database(file: Path) -> LegacyDatabase:
    """Return the contents of a database of the original GARRY. Raises InvalidDatabase."""
    if not file.is_file():
        raise InvalidDatabase(f"There is no file {file}.")
    try:
        with closing(sqlite3.connect(f"file:{quote(str(file))}?mode=ro", uri=True)) as database:
            database.text_factory = lambda text: text.decode(errors="replace")
            health = database.execute("PRAGMA quick_check(1)").fetchone()
            if health != ("ok",):
                raise InvalidDatabase(
                    f"{file.name} is damaged: {health and health[0]}. Find a whole copy."
                )
            people = _read_table(database, "Participants", PARTICIPANTS)
            rows = _read_table(database, "Sessions", SESSIONS)
    except sqlite3.Error as problem:
        raise InvalidDatabase(
            f"{file.name} cannot be read as a SQLite database: {problem}. Find a whole copy."
        ) from problem
    legacy = LegacyDatabase([], name_count=sum(bool(row["name"]) for row in people))
    for place, row in enumerate(people, 1):
        try:
            legacy.participants.append(_parse_integer(row, "participant_id"))
        except InvalidRow as problem:
            message = f"{problem}. Give it a number of its own, in both tables"
            legacy.participant_errors[f"in row {place}"] = message
    known = set(legacy.participants)
    for place, row in enumerate(rows, 1):
        try:
            session = parse_session(row)
            if session.participant not in known:
                raise InvalidRow(f"participant {session.participant} is not in the file")
            legacy.sessions.append(session)
        except InvalidRow as problem:
            key = row["session_id"]
            legacy.session_errors[key if isinstance(key, int) else f"in row {place}"] = str(problem)
    return legacy


def _read_table(
    database: sqlite3.Connection, table: str, columns: tuple[str, ...]
) -> list[dict[str, Any]]:
    """Return a table's rows as dicts. Raises InvalidDatabase for a missing table or column."""
    existing = [row[1].lower() for row in database.execute(f"PRAGMA table_info({table})")]
    if not existing:
        raise InvalidDatabase(
            f"There is no table {table}: this is no data.db of the original GARRY."
        )
    if missing := [name for name in columns if name not in existing]:
        raise InvalidDatabase(
            f"The table {table} lacks {', '.join(missing)}: this is no whole data.db of the "
            "original GARRY."
        )
    query = f"SELECT {', '.join(columns)} FROM {table} ORDER BY 1"  # noqa: S608 (names of ours)
    return [dict(zip(columns, row, strict=True)) for row in database.execute(query)]


def parse_session(row: dict[str, Any]) -> LegacySession:
    """Return the session of a row. Raises InvalidRow."""
    if any(isinstance(value, bytes) for value in row.values()):
        raise InvalidRow("it holds bytes where text or numbers belong")
    valence = str(row["feedback_type"]).strip().lower()
    if valence not in VALENCES:
        raise InvalidRow(f"feedback type {row['feedback_type']!r} is none of {', '.join(VALENCES)}")
    score = row["score"]
    return LegacySession(
        id=_parse_integer(row, "session_id"),
        participant=_parse_integer(row, "participant_id"),
        start=_parse_start(row),
        duration_s=_parse_duration(row["duration"]),
        score=None if score is None else _parse_number(row, "score", MAX_SCORE),
        valence=valence,
        goal=_parse_number(row, "threshold", MAX_SCORE),
        row=row,
    )


def _parse_number(row: dict[str, Any], name: str, limit: float) -> float:
    try:
        number = float(row[name])
    except (TypeError, ValueError):
        number = math.nan
    if not abs(number) <= limit:
        raise InvalidRow(f"{name} {row[name]!r} is no number")
    return number


def _parse_integer(row: dict[str, Any], name: str) -> int:
    number = _parse_number(row, name, 2.0**53)
    if number != int(number):
        raise InvalidRow(f"{name} {row[name]!r} is no whole number")
    return int(number)


def _parse_start(row: dict[str, Any]) -> datetime:
    """Return day and time of the start.

    The stored day is that of the last step: where the start's own date is the day before, the
    session went past midnight.
    """
    year, month, day = (_parse_integer(row, name) for name in ("year", "month", "day"))
    try:
        stored = date(year, month, day)
    except (ValueError, OverflowError):
        stored = date.min
    if stored.year not in YEARS:
        raise InvalidRow(f"year {year}, month {month}, day {day} is no date")
    text = str(row["start_time"]).strip()
    try:
        clock = time.fromisoformat(text).replace(tzinfo=None)
    except ValueError:
        try:
            start = datetime.fromisoformat(text).replace(tzinfo=None)
        except ValueError:
            raise InvalidRow(f"start_time {row['start_time']!r} is no time of day") from None
        if stored - start.date() == timedelta(days=1):
            return start
        clock = start.time()
    return datetime.combine(stored, clock)


def _parse_duration(value: Any) -> float:
    """Return a duration in seconds, from 0:01:22.5 or a number of seconds."""
    parts = re.fullmatch(r"(\d{1,3}):([0-5]?\d):([0-5]?\d(?:\.\d+)?)", str(value).strip())
    if parts is not None:
        hours, minutes, seconds = parts.groups()
        total = int(hours) * 3600 + int(minutes) * 60 + float(seconds)
    else:
        total = _parse_number({"duration": value}, "duration", MAX_DURATION_S)
    if not 0 <= total <= MAX_DURATION_S:
        raise InvalidRow(f"duration {value!r} is no duration")
    return total
