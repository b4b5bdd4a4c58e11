"""Standard tests: what a result may be, what is usual, and which change counts."""

from __future__ import annotations

import pytest

from rehab.questionnaires.standard_tests import CLINICAL_TESTS, Way, to_speed
from rehab.training.measures import InvalidSetting


@pytest.mark.parametrize("test", CLINICAL_TESTS.values(), ids=lambda test: test.slug)
def test_each_is_whole(test):
    assert test.steps
    assert test.least < test.most
    assert [start for start, _low, _high in test.norms] == sorted(n[0] for n in test.norms)
    assert all(test.least <= low <= high <= test.most for _start, low, high in test.norms)
    assert not test.levels or (test.way is Way.SCORE and len(test.levels) == test.most + 1)
    test.check(test.least)
    for wrong in (test.least - 1, test.most + 1, float("nan"), float("inf")):
        with pytest.raises(InvalidSetting, match="lie between"):
            test.check(wrong)


@pytest.mark.parametrize(
    ("slug", "before", "now", "verdict"),
    [
        ("10mwt", 0.78, 0.94, 1),  # exactly the least change
        ("10mwt", 0.78, 0.93, 0),
        ("10mwt", 0.94, 0.78, -1),
        ("tug", 31.0, 28.1, 1),
        ("tug", 28.0, 31.0, -1),
        ("5sts", 20.0, 17.0, 1),
        ("5sts", 20.0, 17.1, 0),
        ("10mwt_fast", 1.0, 1.1, 1),
        ("fac", 2, 3, 1),
        ("berg", 40, 44, 0),
    ],
)
def test_a_change_counts_from_where_it_is_more_than_chance(slug, before, now, verdict):
    assert CLINICAL_TESTS[slug].judge(before, now) == verdict


@pytest.mark.parametrize(
    ("slug", "age", "norm"),
    [
        ("tug", 65, (7.1, 9.0)),
        ("tug", 99, (10.0, 12.7)),
        ("tug", 40, None),
        ("tug", None, None),
        ("6mwt", 70, (471, 527)),
        ("fac", 70, None),
    ],
)
def test_what_is_usual_depends_on_age(slug, age, norm):
    assert CLINICAL_TESTS[slug].find_norm(age) == norm


def test_a_score_is_whole_and_a_speed_has_distance_and_time():
    with pytest.raises(InvalidSetting):
        CLINICAL_TESTS["fac"].check(2.5)
    assert to_speed(10, 12.5) == pytest.approx(0.8)
    for meters, seconds in ((0, 5), (10, 0), (float("nan"), 5)):
        with pytest.raises(InvalidSetting):
            to_speed(meters, seconds)
