"""Where the real recordings lie. They are never part of the project."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("GARRY_TEST_DATA", Path(__file__).parents[3] / "shared" / "data"))


def recording(name: str) -> Path:
    """Return a real recording's path, or skip the test where the recordings are absent."""
    path = DATA / "sessions" / name
    if not path.exists():
        pytest.skip(f"no real recordings at {DATA} (set GARRY_TEST_DATA)")
    return path


def signals(folder: str) -> Path:
    """Return the folder of a real recording of signals, or skip the test where there is none."""
    path = DATA / "raw" / folder
    if not path.exists():
        pytest.skip(f"no real signals at {DATA} (set GARRY_TEST_DATA)")
    return path
