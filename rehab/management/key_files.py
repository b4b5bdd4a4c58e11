"""Files that commands are given: a secret key, and what is encrypted to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from django.core.management import CommandError
from pyrage.x25519 import Identity

from rehab.exports.encryption import InvalidKey, read_identities


def read_key_file(path: Path | None) -> list[Identity]:
    """Return the secret keys of a file that `manage.py backupkey` printed. Raises CommandError."""
    if path is None:
        raise CommandError("Name the file with the secret key: --key KEYFILE.")
    try:
        return read_identities(path.read_text())
    except OSError as problem:
        raise CommandError(f"{path} cannot be read: {problem.strerror}.") from problem
    except ValueError as problem:  # InvalidKey, or no text at all
        cure = problem if isinstance(problem, InvalidKey) else "It is no text file."
        raise CommandError(f"{path} holds no key. {cure}") from problem


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Provide a file to read. Raises CommandError."""
    try:
        file = path.open("rb")
    except OSError as problem:
        raise CommandError(f"{path} cannot be read: {problem.strerror}.") from problem
    with file:
        yield file
