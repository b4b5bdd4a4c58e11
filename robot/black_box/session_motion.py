"""The motion of each session: a file of its own on the robot, and parts of it for the server."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from robot.wire.incident import MOTION_TOPICS, Record
from robot.wire.motion_file import MotionFile

MAX_FILES = 500  # sessions, the newest; some 1 MB for ten minutes
# Of the parts for the server: their length, and the time between two ticks [s] (ours). Ten minutes
# of answers come to some 150 kB. After a session's end a farewell takes up to so long.
PART_S, TICK_EVERY_S, AFTER_S = 60.0, 0.1, 6.0


class SessionMotion:
    """Writes what a black box records into the file of the session that it is of.

    Parameters
    ----------
    folder
        Where the files are.
    to_epoch_s
        Seconds from a record's clock to the time of day [s].
    """

    def __init__(self, folder: Path, to_epoch_s: float) -> None:
        self._folder, self._to_epoch_s = folder, to_epoch_s
        self._session: int | None = None
        self._file: MotionFile | None = None

    def add(self, records: Iterable[Record]) -> None:
        """Write records, oldest first; those without a session are left out. Raises OSError."""
        for record in records:
            match record:
                case {"received": {"type": "welcome", "session": session}}:
                    if session != self._session:
                        self._begin(session, record["at_s"])
            if self._file is not None:
                self._file.add(record, self._to_epoch_s)

    def close(self) -> None:
        """End the file. Raises OSError."""
        file, self._file, self._session = self._file, None, None
        if file is not None:
            file.close()

    def _begin(self, session: int | None, at_s: float) -> None:
        self.close()
        if session is None:
            return
        began = datetime.fromtimestamp(self._to_epoch_s + at_s, UTC)
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"session-{began:%Y%m%dT%H%M%S%fZ}-{session}.mcap"
        self._session, self._file = session, MotionFile(path.open("wb"), session)
        for old in sorted(self._folder.glob("session-*.mcap"))[:-MAX_FILES]:
            old.unlink()


class MotionParts:
    """Collects a session's motion for the server: its number, and the records of a minute each."""

    def __init__(self) -> None:
        self._session: int | None = None
        self._records: list[Record] = []
        self._ticked_s = self._ends_s = float("-inf")
        self._has_moved = False

    def add(self, records: Iterable[Record]) -> Iterator[tuple[int, list[Record]]]:
        """Take records, oldest first, and yield each part that is whole."""
        for record in records:
            at_s = record["at_s"]
            match record:
                case {"received": {"type": "welcome", "session": session}}:
                    if session != self._session:
                        yield from self.take()
                        self._session = session
                case {"received": {"type": "state", "state": state}}:
                    self._ends_s = float("-inf") if state == "running" else at_s + AFTER_S
                case {"sent": {"kind": kind} as report} if kind in MOTION_TOPICS:
                    self._records.append({"at_s": at_s, "sent": report})
                case {"tick": tick} if at_s - self._ticked_s >= TICK_EVERY_S - 0.005:
                    self._ticked_s = at_s
                    aside = {"aside": record["aside"]} if "aside" in record else {}
                    self._records.append({"at_s": at_s, "tick": tick} | aside)
                    self._has_moved = self._has_moved or any(tick[:2]) or bool(aside)
            is_over = self._ends_s > 0 and at_s >= self._ends_s
            if self._records and (is_over or at_s - self._records[0]["at_s"] >= PART_S):
                yield from self.take()

    def take(self) -> Iterator[tuple[int, list[Record]]]:
        """Yield what there is as a part, if it moved at all, and begin the next one."""
        records, has_moved = self._records, self._has_moved
        self._records, self._has_moved, self._ends_s = [], False, float("-inf")
        if self._session is not None and has_moved:
            yield self._session, records
