"""Differences between arms: exact where textbooks have a formula, unbiased by missing visits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from rehab.studies.analysis.comparison import Comparison, Observation, compare

SEED = 38


def observe(
    values: Any, arms: list[str], *, baselines: Any = None, keep: Any = None
) -> list[Observation]:
    """Return observations of values by person and visit. ``keep``: which were made."""
    known = [None] * len(values) if baselines is None else baselines
    return [
        Observation(f"{row}", arms[row], visit + 1, float(value), known[row])
        for row, of_person in enumerate(np.atleast_2d(values))
        for visit, value in enumerate(of_person)
        if keep is None or keep[row, visit]
    ]


def one_difference(found: Comparison):
    [difference] = found.differences
    return difference


def ends(interval) -> tuple[float, float]:
    return interval.low, interval.high


def two_arms(count: int, visits: int, draw) -> tuple[Any, list[str]]:
    arms = ["A", "B"] * (count // 2)
    people = draw.normal(0, 6, (count, 1))
    return people + draw.normal(0, 2, (count, visits)) + np.arange(visits) * 8.0, arms


def test_one_visit_without_baselines_is_students_comparison():
    values, arms = two_arms(13 + 1, 1, np.random.default_rng(SEED))
    found = one_difference(compare(observe(values, arms), ["A", "B"], crossover=False))
    known = stats.ttest_ind(values[1::2, 0], values[::2, 0])
    assert ends(found.difference) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert (found.group, found.reference, found.participants) == ("B", "A", (7, 7))


def test_complete_visits_give_what_the_means_of_people_give():
    values, arms = two_arms(20, 3, np.random.default_rng(SEED))
    found = compare(observe(values, arms), ["A", "B"], crossover=False)
    means = values.mean(axis=1)
    known = stats.ttest_ind(means[1::2], means[::2])
    assert ends(one_difference(found).difference) == pytest.approx(
        tuple(known.confidence_interval(0.95))
    )
    assert found.means["A"].estimate == pytest.approx(means[::2].mean())


def test_a_baseline_is_adjusted_for_as_analysis_of_covariance_does():
    draw = np.random.default_rng(SEED)
    values, arms = two_arms(16, 1, draw)
    baselines = draw.normal(3, 0.5, 16)
    values[:, 0] += 10 * baselines
    observed = observe(values, arms, baselines=baselines)
    found = one_difference(compare(observed, ["A", "B"], crossover=False))
    design = np.column_stack([np.ones(16), np.array(arms) == "B", baselines])
    effects, [squares], *_ = np.linalg.lstsq(design, values[:, 0], rcond=None)
    error = (squares / 13 * np.linalg.inv(design.T @ design)[1, 1]) ** 0.5
    half = stats.t.ppf(0.975, 13) * error
    assert found.difference.estimate == pytest.approx(effects[1])
    assert ends(found.difference) == pytest.approx((effects[1] - half, effects[1] + half))


def test_a_crossover_in_balanced_orders_is_the_textbooks():
    draw = np.random.default_rng(SEED)
    values = draw.normal(0, 5, (12, 1)) + draw.normal(0, 2, (12, 2)) + np.array([0.0, 6.0])
    orders = [("A", "B"), ("B", "A")] * 6
    observed = [
        Observation(f"{row}", orders[row][visit], visit + 1, float(values[row, visit]), None, visit)
        for row in range(12)
        for visit in range(2)
    ]
    found = one_difference(compare(observed, ["A", "B"], crossover=True))
    # Half the difference of the orders' mean period differences (Hills and Armitage 1979).
    apart = values[:, 1] - values[:, 0]
    known = stats.ttest_ind(apart[::2] / 2, apart[1::2] / 2)
    assert ends(found.difference) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert found.paired


def test_who_misses_the_second_visit_at_random_shifts_nothing():
    """Half of one arm lacks the visit at which everybody is 8 better: means are biased."""
    draw = np.random.default_rng(SEED)
    of_model, of_means = [], []
    for _ in range(200):
        values, arms = two_arms(24, 2, draw)
        keep = np.ones((24, 2), bool)
        keep[1:12:2, 1] = False
        found = compare(observe(values, arms, keep=keep), ["A", "B"], crossover=False)
        of_model.append(one_difference(found).difference.estimate)
        means = np.where(keep, values, np.nan)
        people = np.nanmean(means, axis=1)
        of_means.append(people[1::2].mean() - people[::2].mean())
    assert np.mean(of_means) < -1.5  # what was reported before
    assert abs(np.mean(of_model)) < 0.5


def test_interval_and_effect_size_agree_on_zero():
    draw = np.random.default_rng(SEED)
    for _ in range(100):
        values, arms = two_arms(12, 1, draw)
        values[1::2] += draw.uniform(0, 10)
        found = one_difference(compare(observe(values, arms), ["A", "B"], crossover=False))
        signs = [np.sign(end) for end in ends(found.difference)]
        assert signs == [np.sign(end) for end in ends(found.effect)]
    spread = ((values[1::2].var(ddof=1) + values[::2].var(ddof=1)) / 2) ** 0.5
    expected = (1 - 3 / (4 * 10 - 1)) * found.difference.estimate / spread
    assert found.effect.estimate == pytest.approx(expected)


@pytest.mark.parametrize("arms", [["A", "B"], ["A", "A", "B"]])
def test_two_people_give_no_interval(arms):
    values = np.arange(len(arms), dtype=float)[:, None]
    found = one_difference(compare(observe(values, arms), ["A", "B"], crossover=False))
    assert found.difference.low is None
    assert found.effect is None


def test_equal_figures_give_no_effect_size_and_no_warning():
    observed = observe(np.full((8, 1), 2.0), ["A", "B"] * 4)
    found = one_difference(compare(observed, ["A", "B"], crossover=False))
    assert (found.difference.low, found.difference.high, found.effect) == (0, 0, None)


def test_arms_are_compared_over_the_visits_that_all_of_them_walked():
    values, arms = two_arms(12, 2, np.random.default_rng(SEED))
    keep = np.ones((12, 2), bool)
    keep[1::2, 1] = False  # nobody in B has a second visit
    observed = observe(values, arms, keep=keep)
    found = one_difference(compare(observed, ["A", "B"], crossover=False))
    at_first = values[1::2, 0].mean() - values[::2, 0].mean()
    assert found.difference.estimate == pytest.approx(at_first)


def test_a_group_without_figures_is_compared_with_nothing():
    observed = observe(np.ones((3, 1)), ["B"] * 3)
    found = compare(observed, ["A", "B"], crossover=False)
    assert (list(found.means), found.differences) == (["B"], ())
    assert compare([], ["A", "B"], crossover=False) == Comparison({}, ())


def test_arms_and_visits_that_cannot_be_told_apart_are_not_compared():
    observed = [
        Observation(f"{row}", "AB"[period], period + 1, float(row + period), None, period)
        for row in range(5)
        for period in range(2)
    ]
    assert compare(observed, ["A", "B"], crossover=True).differences == ()
