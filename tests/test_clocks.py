"""`make test-clocks` finds a test that is not true on every day, and leaves no test out."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from tests.support import clocks, planted_dates, world

PLANTED = Path(planted_dates.__file__)


@pytest.mark.server
@pytest.mark.long
@pytest.mark.parametrize(
    ("clock", "found"),
    [
        ("the next day", {"test_of_one_day_only"}),
        ("a leap day", {"test_of_one_day_only", "test_of_a_day_that_every_year_has"}),
        ("before midnight", {"test_of_an_hour_that_is_of_the_same_day"}),
    ],
)
def test_what_is_true_on_some_days_only_is_found(capfd, clock, found):
    assert clocks.run(clock, ["-p", "no:cacheprovider", str(PLANTED)]) == 1
    lines = capfd.readouterr().out.splitlines()
    failed = {line.split("::")[1].split()[0] for line in lines if line[:6] == "FAILED"}
    assert found <= failed  # on a slow machine midnight passes before the run ends


def test_each_test_has_its_clock_and_one_that_speaks_of_time_has_all():
    names = [f"tests/test_{number}.py::test" for number in range(600)]
    dealt = Counter(clock for name in names for clock in clocks.clocks_of(name, all_of_them=False))
    assert dealt.total() == len(names)
    assert min(dealt[clock] for clock in clocks.CLOCKS) > 60
    assert clocks.clocks_of(names[0], all_of_them=True) == list(clocks.CLOCKS)


def test_who_speaks_of_time():
    assert clocks.speaks_of_time(planted_dates)
    assert not clocks.speaks_of_time(world)
