"""The newest lines of a log on a disk, in two files that take turns: bounded, however long."""

from __future__ import annotations

from pathlib import Path

# Of each file: at some 15 kB/s of a Kobuki, its bytes included, two to four minutes in both.
FILE_BYTES = 2_000_000


class Ring:
    """Appends text; what is older than two files hold is gone.

    Parameters
    ----------
    folder
        Where its files are; it exists.
    file_bytes
        When the older file is begun anew [bytes].
    """

    def __init__(self, folder: Path, file_bytes: int = FILE_BYTES) -> None:
        self._older, self._newer = folder / "ring-a.jsonl", folder / "ring-b.jsonl"
        self._file_bytes = file_bytes
        self._size = 0

    def begin(self) -> str:
        """Return what an earlier run has left, and begin anew. Raises OSError."""
        left = sorted(
            (path for path in (self._older, self._newer) if path.exists()),
            key=lambda path: path.stat().st_mtime_ns,
        )
        text = "".join(path.read_text("utf-8", "replace") for path in left)
        for path in (self._older, self._newer):
            path.write_bytes(b"")
        self._size = 0
        return text

    def append(self, text: str) -> None:
        """Append whole lines. Raises OSError."""
        data = text.encode()
        if self._size and self._size + len(data) > self._file_bytes:
            self._older, self._newer = self._newer, self._older
            self._newer.write_bytes(b"")
            self._size = 0
        with self._newer.open("ab") as file:
            file.write(data)
        self._size += len(data)

    def read(self) -> str:
        """Return all that there is, the oldest first. Raises OSError."""
        files = (self._older, self._newer)
        return "".join(path.read_text("utf-8", "replace") for path in files)
