"""Files that are replaced whole: after a power cut there is the old one or the new one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def replacing(path: Path, mode: int = 0o600) -> Iterator[BinaryIO]:
    """Provide a new file; at the end of the block, once the disk has it, it replaces another.

    Parameters
    ----------
    path
        The file; a symbolic link is replaced, never followed. Its folder exists.
    mode
        Who may read and write it.

    Raises
    ------
    OSError
        Where it cannot be written; the old file is left as it was, and the new one is removed.
    """
    new = path.with_name(f".{path.name}.new")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    new.unlink(missing_ok=True)
    try:
        with os.fdopen(os.open(new, flags, mode), "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
    if os.name == "posix":  # elsewhere a folder cannot be opened
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)  # the new name as well
        finally:
            os.close(folder)


def write_atomically(path: Path, data: bytes, *, mode: int = 0o600) -> None:
    """Write a file as ``replacing`` does, but through a symbolic link."""
    with replacing(path.resolve(), mode) as file:
        file.write(data)
