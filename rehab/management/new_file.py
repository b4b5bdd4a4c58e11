"""A file that replaces another one only once it is complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from django.core.management import CommandError

from robot.atomic_file import replacing


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
