"""Tests that are not true on every day: tests/test_clocks.py wants them found."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from django.utils import timezone

from tests.support.world import NOW

pytestmark = pytest.mark.django_db


def test_of_one_day_only() -> None:
    assert timezone.now().date() == date(2026, 11, 21)


def test_of_a_day_that_every_year_has() -> None:
    assert NOW.replace(year=NOW.year + 1) > NOW


def test_of_an_hour_that_is_of_the_same_day() -> None:
    assert (NOW + timedelta(hours=1)).date() == NOW.date()


def test_of_a_day_that_has_24_hours() -> None:
    noon = timezone.localtime(NOW).replace(hour=12)
    next_noon = (noon + timedelta(days=1)).timestamp()
    assert next_noon - noon.timestamp() == timedelta(days=1).total_seconds()
