"""What sessions are told as: words in the reader's language."""

from __future__ import annotations

import pytest
from django.utils.translation import override

from rehab.sessions.formatting import format_schedule
from rehab.training.schedules import Schedule, ScheduleKind


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en", "fading to every step"),
        ("de", "seltener bis jeden Schritt"),
        ("es", "cada vez menos, hasta cada paso"),
        ("fr", "de plus en plus rare, jusqu’à chaque pas"),
    ],
)
def test_a_schedule_that_comes_at_each_step_is_told_in_the_singular(language, words):
    with override(language):
        assert format_schedule(Schedule(ScheduleKind.FADED, 1)) == words
        assert "3" in format_schedule(Schedule(ScheduleKind.FADED, 3))
