"""Differences between arms: exact where textbooks have a formula, unbiased by missing visits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import optimize, stats

from rehab.studies.analysis import design_matrix
from rehab.studies.analysis.comparison import Comparison, Interval, carry_over, compare, holm
from rehab.studies.analysis.design_matrix import Observation

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


def test_one_visit_without_baselines_is_welchs_comparison():
    values, arms = two_arms(13 + 1, 1, np.random.default_rng(SEED))
    values[::2] *= 4
    found = one_difference(compare(observe(values, arms), ["A", "B"], crossover=False))
    known = stats.ttest_ind(values[1::2, 0], values[::2, 0], equal_var=False)
    assert found.p == pytest.approx(known.pvalue)
    assert ends(found.difference) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert (found.group, found.reference, found.participants) == ("B", "A", (7, 7))


def test_complete_visits_give_what_the_means_of_people_give():
    values, arms = two_arms(20, 3, np.random.default_rng(SEED))
    found = compare(observe(values, arms), ["A", "B"], crossover=False)
    means = values.mean(axis=1)
    known = stats.ttest_ind(means[1::2], means[::2], equal_var=False)
    assert ends(one_difference(found).difference) == pytest.approx(
        tuple(known.confidence_interval(0.95))
    )
    assert found.means["A"].estimate == pytest.approx(means[::2].mean())


def test_baseline_and_stratum_are_adjusted_for_with_variances_of_each_arm():
    """Against the restricted likelihood's maximum, found by a search of its own."""
    draw = np.random.default_rng(SEED)
    values, arms = two_arms(24, 1, draw)
    baselines = draw.normal(3, 0.5, 24)
    sites = [("north", "south", "east")[row % 3] for row in range(24)]
    values[::2] *= 2
    values[:, 0] += 10 * baselines + 5 * (np.array(sites) == "south")
    observed = observe(values, arms, baselines=baselines)
    observed = [replace(one, strata=(sites[int(one.participant)],)) for one in observed]
    found = one_difference(compare(observed, ["A", "B"], crossover=False))
    is_b = np.array(arms) == "B"
    of_sites = [np.array(sites) == site for site in ("south", "east")]
    x = np.column_stack([~is_b, is_b, baselines, *of_sites]).astype(float)
    y = values[:, 0]

    def solve(logs):
        weight = 1 / np.exp(np.where(is_b, logs[1], logs[0]))
        information = (x.T * weight) @ x
        effects = np.linalg.solve(information, (x.T * weight) @ y)
        squares = (weight * (y - x @ effects) ** 2).sum()
        minus = np.linalg.slogdet(information)[1] - np.log(weight).sum() + squares
        return minus, effects, np.linalg.inv(information)

    minimize: Any = optimize.minimize  # whose stubs know no function that returns a float
    best = minimize(
        lambda logs: float(solve(logs)[0]), np.array([4.0, 4.0]), method="Nelder-Mead", tol=1e-10
    )
    _minus, effects, covariance = solve(best.x)
    apart = np.array([-1, 1, 0, 0, 0])
    assert found.difference.estimate == pytest.approx(effects @ apart, abs=1e-4)
    plain = float(apart @ covariance @ apart) ** 0.5
    assert plain < found.estimate.error < 1.2 * plain  # what Kenward and Roger add
    assert 10 < found.estimate.freedom < 19


def test_precision_is_that_of_the_observed_likelihood_where_visits_are_missing_by_response():
    """Of variances and effects, by differences of the restricted likelihood itself."""
    values, arms = two_arms(40, 2, np.random.default_rng(SEED))
    keep = np.ones((40, 2), bool)
    keep[1::2, 1] = values[1::2, 0] > 0  # the worse half of B
    design = design_matrix.parallel(observe(values, arms, keep=keep), ["A", "B"])
    fitted, seen = design.fit, design.seen
    x, y = design.x[seen][:, :4], design.y[seen]  # of each arm at each visit: no baselines
    person = np.repeat(np.arange(40), 2).reshape(40, 2)[seen]
    visit = np.tile([0, 1], 40).reshape(40, 2)[seen]
    together = person[:, None] == person[None, :]
    parts = design.parts[:, person[:, None], visit[:, None], visit[None, :]] * together

    def solve(variances):
        covariance = np.einsum("v,vab->ab", variances, parts)
        weight = np.linalg.inv(covariance)
        information = x.T @ weight @ x
        effects = np.linalg.solve(information, x.T @ weight @ y)
        rest = y - x @ effects
        logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1]
        return -(logs + rest @ weight @ rest) / 2, effects

    at, step = fitted.variances, 1e-3
    moved = step * np.eye(len(at))
    slopes = np.array([(solve(at + h)[1] - solve(at - h)[1]) / (2 * step) for h in moved])
    curved = np.array(
        [
            [
                sum(s * u * solve(at + s * h + u * k)[0] for s in (1, -1) for u in (1, -1))
                for h in moved
            ]
            for k in moved
        ]
    ) / (4 * step**2)
    known = np.linalg.inv(-curved)
    assert fitted.of_variances == pytest.approx(known, rel=1e-3, abs=1e-3 * known.max())
    added = 2 * slopes.T @ known @ slopes
    found = (fitted.adjusted - fitted.plain)[:4, :4]
    assert found == pytest.approx(added, rel=1e-2, abs=1e-3 * added.max())
    assert found[3, 3] > 0.1 * fitted.plain[3, 3]  # of B at the second visit


# Potthoff and Roy 1964, Biometrika 51:313-326: a distance in the skull of children [mm].
BOYS = [
    *((26, 25, 29, 31), (21.5, 22.5, 23, 26.5), (23, 22.5, 24, 27.5), (25.5, 27.5, 26.5, 27)),
    *((20, 23.5, 22.5, None), (24.5, 25.5, 27, 28.5), (22, 22, 24.5, 26.5)),
    *((24, 21.5, 24.5, 25.5), (23, 20.5, 31, 26), (27.5, 28, 31, 31.5), (23, 23, None, None)),
    *((21.5, 23.5, 24, 28), (17, 24.5, 26, 29.5), (22.5, 25.5, 25.5, 26), (23, 24.5, 26, 30)),
    (22, 21.5, 23.5, 25),
]
GIRLS = [
    *((21, 20, 21.5, 23), (21, 21.5, 24, 25.5), (20.5, 24, 24.5, None), (23.5, 24.5, 25, 26.5)),
    *((21.5, 23, 22.5, 23.5), (20, 21, 21, 22.5), (21.5, 22.5, 23, 25), (23, 23, 23.5, 24)),
    *((20, 21, 22, 21.5), (16.5, 19, 19, 19.5), (24.5, 25, 28, 28)),
]


def test_a_published_data_set_with_four_visits_and_missing_ones_gives_what_r_does():
    """R 4.2.2, nlme 3.1-162: lme(distance ~ 0 + factor(age), ~ 1 | Subject) of each sex."""
    observed = [
        Observation(f"{sex}{row}", sex, visit, value)
        for sex, people in (("B", BOYS), ("G", GIRLS))
        for row, values in enumerate(people)
        for visit, value in enumerate(values, 1)
    ]
    found = compare(observed, ["G", "B"], crossover=False)
    assert found.means["B"].estimate == pytest.approx(25.040468376)
    assert found.means["G"].estimate == pytest.approx(22.619836091)
    assert one_difference(found).difference.estimate == pytest.approx(2.4206322850)
    fitted = design_matrix.parallel(observed, ["G", "B"]).fit
    variances = [0.6361399, 2.946047, 4.2178056, 2.537326]
    assert fitted.variances == pytest.approx(variances, rel=1e-5)
    weights = design_matrix.parallel(observed, ["G", "B"]).weights
    apart = weights["B"] - weights["G"]
    assert float(apart @ fitted.plain @ apart) ** 0.5 == pytest.approx(0.7788313766)


# Senn 2002, Cross-over Trials in Clinical Research, table 3.1: peak flow [l/min] of 13 children,
# after formoterol and salbutamol; the first seven had formoterol first.
FORMOTEROL = [310, 310, 370, 410, 250, 380, 330, 385, 400, 410, 320, 340, 220]
SALBUTAMOL = [270, 260, 300, 390, 210, 350, 365, 370, 310, 380, 290, 260, 90]


def asthma() -> list[Observation]:
    return [
        Observation(f"{row}", arm, period + 1, float(value), None, period)
        for row, pair in enumerate(zip(FORMOTEROL, SALBUTAMOL, strict=True))
        for arm, value in zip("FS", pair, strict=True)
        for period in [int((arm == "S") == (row < 7))]
    ]


def test_a_published_crossover_gives_what_the_book_does():
    found = one_difference(compare(asthma(), ["S", "F"], crossover=True))
    assert found.difference.estimate == pytest.approx(46.6, abs=0.05)
    assert found.estimate.error == pytest.approx(10.8, abs=0.05)
    assert found.estimate.freedom == pytest.approx(11)


def test_carry_over_is_the_difference_of_peoples_sums():
    [found] = carry_over(asthma(), ["S", "F"])
    sums = np.array(FORMOTEROL) + np.array(SALBUTAMOL)
    known = stats.ttest_ind(sums[:7], sums[7:])  # Grizzle 1965, Biometrics 21:467-480
    assert found.p == pytest.approx(known.pvalue)
    assert found.difference.estimate == pytest.approx(sums[:7].mean() - sums[7:].mean())
    assert carry_over([one for one in asthma() if one.period == 0], ["S", "F"]) == ()


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


def test_missing_visits_move_the_difference_by_their_share_and_as_many_imputations_do():
    draw = np.random.default_rng(SEED)
    values, arms = two_arms(40, 1, draw)
    values[1::2] += 9
    here = np.ones(40, bool)
    here[1:13:2] = False  # six of twenty in B
    observed = [
        Observation(f"{row}", arms[row], 1, float(values[row, 0]) if here[row] else None)
        for row in range(40)
    ]
    found = one_difference(compare(observed, ["A", "B"], crossover=False))
    assert found.missing.visits == (6, 0)
    assert found.missing.slope == pytest.approx(6 / 20)
    delta, in_a, in_b = 5.0, values[::2, 0], values[1::2, 0][here[1::2]]
    estimates, within = [], []
    for _ in range(4000):  # Rubin's rules, with the posterior of a normal arm
        variance = in_b.var(ddof=1) * 13 / draw.chisquare(13)
        mean = draw.normal(in_b.mean(), (variance / 14) ** 0.5)
        filled = np.concatenate([in_b, draw.normal(mean, variance**0.5, 6) - delta])
        estimates.append(filled.mean() - in_a.mean())
        within.append(filled.var(ddof=1) / 20 + in_a.var(ddof=1) / 20)
    total = np.mean(within) + np.var(estimates)
    shifted = found.missing.shifted(delta)
    assert shifted.value == pytest.approx(np.mean(estimates), abs=0.1)
    assert shifted.error == pytest.approx(total**0.5, rel=0.1)
    tipping = found.missing.tipping_point(0.95)
    assert found.tipping_point(None, None) == found.tipping_point(found.p, 0.05) == tipping
    assert found.tipping_point(2 * found.p, 0.05) == found.missing.tipping_point(0.975) < tipping
    assert found.tipping_point(0.06, None) is None  # by Holm nothing is found
    low, _high = found.missing.shifted(tipping).interval(0.95)
    assert low == pytest.approx(0, abs=1e-9)
    swapped = [replace(one, arm="BA"["AB".index(one.arm)]) for one in observed]
    other = one_difference(compare(swapped, ["A", "B"], crossover=False)).missing
    assert other.tipping_point(0.95) == pytest.approx(tipping)
    assert other.shifted(tipping).interval(0.95)[1] == pytest.approx(0, abs=1e-9)


def test_an_interval_of_a_share_ends_where_shares_end():
    assert Interval(0.8, 0.5, 1.1).within(0, 1) == Interval(0.8, 0.5, 1)
    assert Interval(0.8).within(0, 1) == Interval(0.8)


def test_nothing_is_missing_or_nothing_can_tip():
    values, arms = two_arms(20, 1, np.random.default_rng(SEED))
    assert one_difference(compare(observe(values, arms), "AB", crossover=False)).missing is None
    observed = [*observe(values, arms), Observation("x", "B", 1, None)]
    found = one_difference(compare(observed, "AB", crossover=False))
    assert found.missing.visits == (1, 0)
    assert found.missing.tipping_point(0.95) is None  # zero is in the interval already


def test_who_never_came_or_came_for_another_outcome_changes_no_estimate():
    values, arms = two_arms(20, 1, np.random.default_rng(SEED))
    observed = observe(values, arms)
    more = [Observation("x", "B", 1, None, 3.0), Observation("0", "A", 2, None)]
    alone, both = (
        one_difference(compare(some, "AB", crossover=False)) for some in (observed, observed + more)
    )
    assert both.difference.estimate == pytest.approx(alone.difference.estimate)
    assert ends(both.difference) == pytest.approx(ends(alone.difference))


def test_holm_steps_down():
    # Holm 1979's rule by hand: 4 x 0.01, 3 x 0.02, then never less, never more than 1.
    assert holm([0.04, 0.01, 0.9, 0.02]) == pytest.approx([0.08, 0.04, 0.9, 0.06])
    assert holm([]) == []
    assert holm([0.6, 0.7]) == [1.0, 1.0]


@pytest.mark.parametrize(
    ("shift", "better", "expected"),
    [(-1, True, False), (4, True, True), (-4, False, True), (1, False, False)],
)
def test_a_group_is_not_inferior_where_its_interval_leaves_out_the_margin(shift, better, expected):
    values, arms = two_arms(40, 1, np.random.default_rng(SEED))
    values[1::2] += shift - values[1::2].mean() + values[::2].mean()
    found = one_difference(compare(observe(values, arms), "AB", crossover=False))
    half = (found.difference.high - found.difference.low) / 2
    margin = half - 2
    assert found.is_not_inferior(margin, higher_is_better=better) is expected
