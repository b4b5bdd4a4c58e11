"""Run database tests by other clocks than today's: `make test-clocks`.

Each clock begins as it does something rare. A test whose module speaks of time (it imports
something of datetime, zoneinfo or Django's timezone) runs by all of them. The others are dealt
out, each to one, by its name: the same one every time. Those marked `long` have short ones of
their kind.
"""

from __future__ import annotations

import os
import subprocess
import sys
import zlib
from types import ModuleType

import pytest

CLOCKS = {
    "the next day": ("2026-11-22T10:00:00+00:00", "UTC"),
    "40 days later, another year tomorrow": ("2026-12-31T10:00:00+00:00", "UTC"),
    "a leap day": ("2028-02-29T12:00:00+00:00", "UTC"),
    "before clocks go forward": ("2027-03-28T00:59:58+00:00", "Europe/Berlin"),
    "before clocks go back": ("2026-11-01T05:59:58+00:00", "America/New_York"),
    "before midnight": ("2026-11-21T23:59:50+00:00", "UTC"),
}
TESTS = "database and not (browser or realtime or long or bench or screenshots)"
TIME = {"datetime", "zoneinfo", "django.utils.timezone"}


def speaks_of_time(module: ModuleType) -> bool:
    """Return whether a module has imported anything of time."""
    return any(
        (value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", ""))
        in TIME
        for value in vars(module).values()
    )


def clocks_of(name: str, *, all_of_them: bool) -> list[str]:
    """Return the clocks that a test of that name runs by."""
    clocks = list(CLOCKS)
    return clocks if all_of_them else [clocks[zlib.crc32(name.encode()) % len(clocks)]]


def run(clock: str, arguments: list[str]) -> int:
    """Run the tests that are for a clock by it; return pytest's status."""
    moment, zone = CLOCKS[clock]
    print(f"Database tests by another clock: {clock} ({moment}, {zone})", flush=True)
    command = [sys.executable, "-m", "pytest", "-q", "-p", __spec__.name, "-m", TESTS, *arguments]
    given = {"GARRY_TEST_CLOCK": moment, "GARRY_TEST_ZONE": zone, "GARRY_TEST_DEALT": clock}
    return subprocess.run(command, env=os.environ | given, check=False).returncode


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Function]) -> None:
    """Leave the tests that are for this clock. (pytest calls it in the runs that `run` starts.)"""
    clock = os.environ["GARRY_TEST_DEALT"]
    kept = {
        item
        for item in items
        if clock in clocks_of(item.nodeid, all_of_them=speaks_of_time(item.module))
    }
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = [item for item in items if item in kept]


def main(arguments: list[str]) -> int:
    """Run the tests by each clock; return how many clocks found a fault."""
    failed = [clock for clock in CLOCKS if run(clock, arguments) not in (0, 5)]  # 5: none to run
    if failed:
        print(f"Faults by these clocks: {', '.join(failed)}. Try one again: GARRY_TEST_CLOCK=…")
    return len(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
