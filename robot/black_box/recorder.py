"""The black box of a robot: the last minutes on its disk, retained where something stopped it.

Nothing here holds up the loop that drives the base: it appends to a list in memory, and a thread
writes. Where the disk is too slow, the oldest records are dropped and counted. A power cut may lose
the last seconds: they are written every half second, but the disk may take its time.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, Self

from robot.atomic_file import write_atomically
from robot.black_box.ring import Ring
from robot.black_box.session_motion import MotionParts, SessionMotion
from robot.wire.incident import MOTION, Record, pack, read_lines, to_lines

WAITING = 6_000  # records in memory: of a minute
WRITE_EVERY_S = 0.5
BEFORE_S, AFTER_S = 30.0, 5.0  # of an incident
MAX_FILES = 50  # the newest; some 0.6 MB each
TO_SEND = 4  # incidents that wait for the server
PARTS_TO_SEND = 60  # of motion: an hour

CLOSED = "closed"
DIED = "worker_died"


class Incident(NamedTuple):
    """A retained recording: why, in which session, when by our clock [s], and its text."""

    reason: str
    session: int | None
    at_s: float
    recording: str


class _Retention(NamedTuple):
    """What is to be retained once its last seconds are recorded."""

    reason: str
    session: int | None
    at: datetime
    at_s: float


class BlackBox:
    """Records on a thread of its own, as a context manager.

    Parameters
    ----------
    folder
        Of this robot alone; made where it does not exist.
    monotonic
        The clock of the records [s].
    now
        The time of day.
    keeps_motion
        Whether the motion of each session is kept as MCAP; the package mcap has to be there.

    Attributes
    ----------
    incidents
        Those to send, oldest first; the sender pops them from the left.
    motion
        Parts of the session's motion to send, likewise.
    lost
        How many records were dropped.
    problem
        Why nothing is written, for people; empty where it is.
    """

    def __init__(
        self,
        folder: Path,
        monotonic: Callable[[], float] = time.monotonic,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
        *,
        keeps_motion: bool = False,
    ) -> None:
        self.folder = folder
        self.incidents: deque[Incident] = deque(maxlen=TO_SEND)
        self.motion: deque[Incident] = deque(maxlen=PARTS_TO_SEND)
        self._parts = MotionParts()
        self.lost, self.problem = 0, ""
        self._monotonic, self._now = monotonic, now
        self._ring = Ring(folder)
        self._motion: SessionMotion | None = None
        if keeps_motion:
            self._motion = SessionMotion(folder / "sessions", now().timestamp() - monotonic())
        self._waiting: deque[Record] = deque()
        self._reported_lost = 0
        self._retention: _Retention | None = None
        self._is_closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="black box", daemon=True)

    def __enter__(self) -> Self:
        """Begin to record. What a run before it left without closing is retained."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write the rest, for a second at most, where the disk answers."""
        self.note(retained=CLOSED)
        self._is_closing.set()
        self._thread.join(1.0)

    def note(self, **what: Any) -> None:
        """Record something that happened now. Never waits, and never raises."""
        if len(self._waiting) >= WAITING:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append({"at_s": round(self._monotonic(), 3), **what})

    def retain(self, reason: str, session: int | None) -> None:
        """Retain the recording around now; within that of an earlier reason, only note this one.

        Parameters
        ----------
        reason
            What stopped the robot, as a code.
        session
            Number of the session that it was in; None for none.
        """
        is_first = self._retention is None
        self.note(retained=reason, is_first=is_first)
        if is_first:
            self._retention = _Retention(reason, session, self._now(), self._monotonic())

    def begin(self) -> None:
        """Make the folder, and retain what a worker that died has left. Raises OSError."""
        self.folder.mkdir(parents=True, exist_ok=True)
        left = read_lines(self._ring.begin())
        if left and left[-1].get("retained") != CLOSED:
            self._store(_Retention(DIED, None, self._now(), left[-1]["at_s"]), left)

    def write(self) -> None:
        """Write what waits, and an incident that is over. Raises OSError."""
        records: list[Record] = []
        if self.lost > self._reported_lost:
            records.append(
                {"at_s": round(self._monotonic(), 3), "lost": self.lost - self._reported_lost}
            )
            self._reported_lost = self.lost
        while self._waiting:
            records.append(self._waiting.popleft())
        try:
            self._ring.append(to_lines(records))
        except OSError:
            self.lost += len(records)
            raise
        for session, part in self._parts.add(records):
            self.motion.append(Incident(MOTION, session, part[-1]["at_s"], pack(part)))
        if self._motion is not None:
            self._motion.add(records)
            if self._is_closing.is_set():
                self._motion.close()
        retention = self._retention
        if retention is not None and (
            self._is_closing.is_set() or self._monotonic() - retention.at_s >= AFTER_S
        ):
            self._retention = None
            stored = self._store(retention, read_lines(self._ring.read()))
            incident = Incident(retention.reason, retention.session, retention.at_s, pack(stored))
            self.incidents.append(incident)

    def _store(self, retention: _Retention, recorded: list[dict[str, Any]]) -> list[Record]:
        """Write the file of an incident, and return its records; remove the oldest files."""
        from_s, until_s = retention.at_s - BEFORE_S, retention.at_s + AFTER_S
        records: list[Record] = [one for one in recorded if from_s <= one["at_s"] <= until_s]
        path = self.folder / f"incident-{retention.at:%Y%m%dT%H%M%S%fZ}-{retention.reason}.jsonl"
        write_atomically(path, to_lines(records).encode(), mode=0o644)
        for old in sorted(self.folder.glob("incident-*.jsonl"))[:-MAX_FILES]:
            old.unlink()
        return records

    def _run(self) -> None:
        has_begun = is_over = False
        while not is_over:
            is_over = self._is_closing.wait(WRITE_EVERY_S)
            try:
                if not has_begun:
                    self.begin()
                    has_begun = True
                self.write()
                self.problem = ""
            except OSError as problem:
                self.problem = f"The black box {self.folder} cannot be written: {problem}."
