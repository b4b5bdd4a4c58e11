"""The clock of database tests: each begins at one moment, from which time goes on.

A test that judges dates by ``START`` and a page that reads the clock then agree on every day.
`make test-clocks` tries other moments (`clocks.py`): GARRY_TEST_CLOCK is a moment with its offset,
GARRY_TEST_ZONE the time zone that clinics are in. No Django up here, as in tests/conftest.py.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

import pytest

START = datetime.fromisoformat(os.environ.get("GARRY_TEST_CLOCK") or "2026-11-21T10:00:00+00:00")
ZONE = os.environ.get("GARRY_TEST_ZONE") or "UTC"
HERE = START.astimezone(ZoneInfo(ZONE))  # as a clinic's clock shows it
NAME = f"{START:%Y-%m-%d-%H%M%S}-{ZONE.replace('/', '-')}"  # of the clock, for a file

# Their children (servers, Chromium) have the machine's clock, or they measure it.
REAL = ("bench", "browser", "realtime", "screenshots")


def has_real_clock(item: pytest.Item) -> bool:
    """Whether a test runs by the machine's clock, as all do that use no database."""
    return item.get_closest_marker("database") is None or any(
        item.get_closest_marker(name) for name in REAL
    )


@contextmanager
def just_before() -> Iterator[None]:
    """Let it be two seconds before ``START``: what is made is older than any test."""
    import time_machine

    with time_machine.travel(START - timedelta(seconds=2), tick=True):
        yield


@contextmanager
def started() -> Iterator[None]:
    """Begin at ``START``, in clinics of ``ZONE``, and let time go on from there."""
    import time_machine

    from rehab.people.models import Clinic

    zone = Clinic._meta.get_field("time_zone")
    zone.default = ZONE
    vars(zone).pop("_get_default", None)  # Django keeps it once it was asked for
    with time_machine.travel(START, tick=True):
        yield
