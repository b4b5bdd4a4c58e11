"""A file that replaces another one only once it is complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from django.core.management import CommandError


@contextmanager
def new_file(file: Path) -> Iterator[BinaryIO]:
    """Provide a new file that only its owner reads; it gets its name at the end of the block.

    Raises CommandError where it cannot be written.
    """
    new = file.with_name(f".{file.name}.new")
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW  # never through a link
    try:
        with os.fdopen(os.open(new, flags, 0o600), "wb") as out:
            yield out
            out.flush()
            os.fsync(out.fileno())
        new.replace(file)
        folder = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as problem:
        raise CommandError(
            f"{file} cannot be written ({problem.strerror}). Choose another place."
        ) from problem
    finally:
        new.unlink(missing_ok=True)
