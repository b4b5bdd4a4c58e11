"""Files that are replaced whole: after a power cut there is the old one or the new one."""

from __future__ import annotations

import os
from pathlib import Path


def write_atomically(path: Path, data: bytes, *, mode: int = 0o600) -> None:
    """Write a file under another name beside it, and replace it once the disk has the new one.

    Parameters
    ----------
    path
        The file; a symbolic link is followed. Its folder exists.
    data
        What it holds then.
    mode
        Who may read and write it.

    Raises
    ------
    OSError
        Where it cannot be written; the old file is left as it was, and the new one is removed.
    """
    path = path.resolve()
    new = path.with_name(f".{path.name}.new")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    new.unlink(missing_ok=True)
    try:
        with os.fdopen(os.open(new, flags, mode), "wb") as file:
            file.write(data)
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
