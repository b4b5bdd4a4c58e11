"""The file that holds a device's token, in which the server replaces it from time to time."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from robot.atomic_file import write_atomically


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
        """Store a token in place of the old one; return whether the disk has it."""
        try:
            write_atomically(self._path, f"{token}\n".encode("ascii"))
        except OSError as problem:
            self._notify(
                f"The server gave a new token, which {self._path} cannot take "
                f"({problem.strerror}): the old one goes on. Let this account write the file and "
                "its folder, and make room."
            )
            return False
        return True
