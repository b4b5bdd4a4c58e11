"""Keeps what pybullet prints apart from the twin's answers."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


def redirect_output() -> int:
    """Return a file for answers alone in place of standard output, and import pybullet.

    pybullet prints past Python: its build date when it is imported, and more when it ends.
    """
    answers, errors = os.dup(1), os.dup(2)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    with contextlib.suppress(ImportError):
        import pybullet  # noqa: F401
    os.dup2(errors, 2)
    os.close(errors)
    return answers
