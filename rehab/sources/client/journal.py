"""A file with what the server has not stored yet, over ends of this program and power cuts.

A line is the CRC-32 of a JSON object and the object: what a power cut tore or left blank at the
end is distinguished from what was written. When the file has grown it is written anew, beside
itself.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from threading import Lock

from rehab.sources.client.journal_state import (
    JournalState,
    Message,
    read_line,
    select_fitting,
    write_line,
)
from rehab.sources.reporting import Notify, SourceError

REWRITE_BYTES = 1024 * 1024  # of lines that are not needed any more
TRY_AGAIN_S = 10.0  # after the disk, or the room for the journal, was full


class Journal:
    """Keeps a session's unstored steps in a file of at most so many bytes.

    Where there is no room, what is there stays, later strides are in memory only, and that is said;
    all is written again once there is room.

    Parameters
    ----------
    path
        The file; only its owner can read it.
    server
        Whose steps these are: a journal of another server is not used.
    max_bytes
        How large it may become.
    notify
        Called with lines for the person who runs the source.
    monotonic
        Our clock [s].

    Raises
    ------
    SourceError
        Where the file cannot be used; the message says why.
    """

    def __init__(
        self,
        path: Path,
        server: str,
        max_bytes: int,
        notify: Notify,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.path, self._server, self._max_bytes = path, server, max_bytes
        self._notify, self._monotonic = notify, monotonic
        self.trouble = ""  # why the latest strides are in memory only
        self._retry_s = 0.0
        # Of the file, which is not changed for another while a thread waits for the disk; lines are
        # written meanwhile.
        self._lock = Lock()
        self._file = -1
        self._size = self._needed = 0
        self._is_dirty = False
        self._guard = -1
        try:
            self._guard = _take(path)
            self.saved = self._read()
            self._replace(self.saved)
        except (OSError, SourceError) as problem:
            if self._guard >= 0:
                os.close(self._guard)
            if isinstance(problem, SourceError):
                raise
            raise SourceError(
                f"The journal {path} cannot be used: {problem.strerror}. Name a file that this "
                "account may write."
            ) from None
        if self.saved.steps:
            notify(
                f"{len(self.saved.steps)} strides of session {self.saved.session} are in {path} "
                "and not stored yet: they are sent as late ones."
            )

    def _read(self) -> JournalState:
        """Return what the file says, up to where it is damaged. Raises SourceError."""
        state = JournalState()
        try:
            data = self.path.read_bytes()
        except FileNotFoundError:
            return state
        lines = data.splitlines(keepends=True)
        first = read_line(lines[0]) if lines else None
        if first is None or "journal" not in first:
            if not data.strip(b"\0"):
                return state  # made just before the power went
            raise SourceError(
                f"{self.path} is no journal of a source. Name another file, which may be a new one."
            )
        if first["journal"] != self._server:
            raise SourceError(
                f"{self.path} is the journal of a source for {first['journal']}, not for "
                f"{self._server}. Name another file; delete this one if its strides are not wanted."
            )
        read = len(lines[0])
        for line in lines[1:]:
            entry = read_line(line)
            if entry is None:
                break
            try:
                state = state.after(entry)
            except (KeyError, TypeError, ValueError):
                break
            read += len(line)
        if b"\n" in data[read:].strip(b"\0"):  # more than one torn line
            aside = self._write_aside("damaged", data)
            self._notify(
                f"{self.path} is damaged from byte {read} on: what stood there is not sent. The "
                f"whole file is kept as {aside}; the disk may be failing."
            )
        if state.session is not None and state.unsent_from is None:
            state.unsent_from = state.last + 1
        return state

    def put_aside(self) -> None:
        """Keep a copy of what is there, for a person: it is not sent."""
        try:
            aside = self._write_aside("aside", self.path.read_bytes())
        except OSError as problem:
            self._suffer(f"cannot be copied ({problem.strerror})")
        else:
            self._notify(
                "The server has less of the session than it had acknowledged: it seems to run on "
                f"an older copy of its database. What is not stored is not sent: it is in {aside}."
            )

    def _write_aside(self, kind: str, data: bytes) -> Path:
        aside = self.path.with_name(f"{self.path.name}.{kind}")
        aside.write_bytes(data)
        return aside

    # --- Noting ---

    def note(self, entry: Message, read_state: Callable[[], JournalState]) -> None:
        """Add a line: a step, an acknowledgment, a new state.

        ``read_state`` returns all that is to be saved after it, for a file that is written anew.
        """
        line = write_line(entry)
        if self.trouble:
            if self._monotonic() >= self._retry_s:
                self.renew(read_state())
            return
        if self._size + len(line) > self._max_bytes or (
            "ack" in entry and self._size > REWRITE_BYTES + 2 * self._needed
        ):
            self.renew(read_state())
            return
        try:
            self._write(line)
        except OSError as problem:
            self._suffer(f"cannot be written ({problem.strerror})")

    def renew(self, state: JournalState) -> None:
        """Write the file anew with what is to be saved, as far as there is room."""
        try:
            whole = self._replace(state)
        except OSError as problem:
            self._suffer(f"cannot be written ({problem.strerror})")
            return
        if not whole:
            self._suffer(f"has the {self._max_bytes / 1e6:.0f} MB that it may have")
        elif self.trouble:
            self.trouble = ""
            self._notify(f"{self.path} has all strides again.")

    def sync(self) -> None:
        """Wait until the disk has what was written; called from a thread of its own."""
        with self._lock:
            self._is_dirty = False
            if self._file < 0:
                return  # it could not be opened again, which was said
            try:
                os.fsync(self._file)
            except OSError as problem:
                self._suffer(f"cannot be written ({problem.strerror})")

    @property
    def is_dirty(self) -> bool:
        """Whether something was written that the disk may not have."""
        return self._is_dirty

    def close(self) -> None:
        """Close the file."""
        if self._file >= 0:
            self.sync()
            os.close(self._file)
            os.close(self._guard)
            self._file = -1

    def _suffer(self, why: str) -> None:
        self._retry_s = self._monotonic() + TRY_AGAIN_S
        if not self.trouble:
            self._notify(
                f"The journal {self.path} {why}: later strides are in memory only, and lost if "
                "this program or computer ends before the server has them. Make room on the disk, "
                "or bring the server back."
            )
        self.trouble = why

    def _write(self, data: bytes) -> None:
        while data:
            written = os.write(self._file, data)
            data = data[written:]
            self._size += written
        self._is_dirty = True

    def _replace(self, state: JournalState) -> bool:
        """Write the file anew, at once and to the disk; return whether all had room."""
        head = (write_line({"journal": self._server}), write_line(state.header()))
        lines, whole = select_fitting(head, state.steps, self._max_bytes)
        new = self.path.with_name(f"{self.path.name}.new")
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0)
        file = os.open(new, flags, 0o600)
        try:
            data = b"".join(lines)
            while data:
                data = data[os.write(file, data) :]
            os.fsync(file)
        finally:
            os.close(file)
        with self._lock:
            if self._file >= 0:  # Windows replaces no file that is open
                old, self._file = self._file, -1  # what is opened next may get its number
                os.close(old)
            try:
                new.replace(self.path)
            finally:
                append = os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0)
                self._file = os.open(self.path, append)
            self._size = self._needed = sum(map(len, lines))
        if os.name == "posix":
            folder = os.open(self.path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)  # the new name as well
            finally:
                os.close(folder)
        return whole


def _take(path: Path) -> int:
    """Take the file that says that a journal is in use, until this process ends.

    Raises SourceError where another one has it.
    """
    guard = os.open(path.with_name(f"{path.name}.lock"), os.O_RDWR | os.O_CREAT, 0o600)
    try:
        if os.name == "posix":
            fcntl = import_module("fcntl")
            fcntl.flock(guard, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            msvcrt = import_module("msvcrt")
            msvcrt.locking(guard, msvcrt.LK_NBLCK, 1)
    except OSError:
        os.close(guard)
        raise SourceError(
            f"Another source uses the journal {path}. Stop it, or name a file of "
            "its own for each source."
        ) from None
    return guard
