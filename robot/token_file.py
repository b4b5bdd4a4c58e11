"""The file that holds a device's token, in which the server replaces it from time to time."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path


class TokenFile:
    """A file that only its owner can read; ``notify`` is called with lines for a person."""

    def __init__(self, path: Path, notify: Callable[[str], None]) -> None:
        self._path = path.resolve()  # not a link to it
        self._notify = notify

    @property
    def is_writable(self) -> bool:
        """Whether another token can be stored: the file is written anew beside itself."""
        return os.access(self._path, os.W_OK) and os.access(self._path.parent, os.W_OK)

    def keep(self, token: str) -> bool:
        """Store a token in place of the old one; return whether the disk has it.

        After a power cut there is the old one or the new one, whole.
        """
        new = self._path.with_name(f"{self._path.name}.new")
        try:
            new.unlink(missing_ok=True)
            file = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(file, "w", encoding="ascii") as text:
                text.write(f"{token}\n")
                text.flush()
                os.fsync(text.fileno())
            new.replace(self._path)
            if os.name == "posix":
                folder = os.open(self._path.parent, os.O_RDONLY)
                try:
                    os.fsync(folder)
                finally:
                    os.close(folder)
        except OSError as problem:
            self._notify(
                f"The server gave a new token, which {self._path} cannot take "
                f"({problem.strerror}): the old one goes on. Let this account write the file and "
                "its folder, and make room."
            )
            return False
        return True
