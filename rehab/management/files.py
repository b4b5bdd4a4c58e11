"""Files that commands are given or write: a secret key, what is encrypted to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from django.core.management import CommandError
from pyrage.x25519 import Identity

from rehab.exports.encryption import InvalidKey, read_identities
from robot.atomic_file import replacing


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


@contextmanager
def new_file(file: Path) -> Iterator[BinaryIO]:
    """Provide a new file that only its owner reads; it gets its name at the end of the block.

    Raises CommandError where it cannot be written.
    """
    try:
        with replacing(file) as out:
            yield out
    except OSError as problem:
        raise CommandError(
            f"{file} cannot be written ({problem.strerror}). Choose another place."
        ) from problem
