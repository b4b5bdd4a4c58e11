"""Bounds of looks before the end, against published tables and another integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import multivariate_normal

from rehab.studies.analysis.sequential import SPENDING, blinded_size, bounds, levels

# Five equal looks at 5 % two-sided: Reboussin, DeMets, Kim and Lan 2000 (Controlled Clinical Trials
# 21:190-207), as the R package ldbounds prints them.
PUBLISHED = {
    "obrien_fleming": [4.8769, 3.3569, 2.6803, 2.2898, 2.0310],
    "pocock": [2.4380, 2.4268, 2.4101, 2.3966, 2.3859],
}


@pytest.mark.parametrize("spending", SPENDING)
def test_bounds_are_those_of_published_tables(spending):
    found = -ndtri(np.array(levels(spending, [12, 24, 36, 48, 60], 60, is_last=True)) / 2)
    assert found == pytest.approx(PUBLISHED[spending], abs=2e-4)


# Jennison and Turnbull 2000, Group Sequential Methods, tables 2.1 and 2.3, at 5 % two-sided.
@pytest.mark.parametrize(
    ("looks", "pocock", "obrien_fleming"),
    [(2, 2.178, 1.977), (3, 2.289, 2.004), (4, 2.361, 2.024), (5, 2.413, 2.040)],
)
def test_constants_of_pocock_and_of_obrien_and_fleming(looks, pocock, obrien_fleming):
    at = np.arange(1, looks + 1)
    for wanted in (np.full(looks, pocock), obrien_fleming * np.sqrt(looks / at)):
        spent = np.diff([crossing(at[:k], wanted[:k]) for k in range(looks + 1)])
        assert spent.sum() == pytest.approx(0.05, abs=3e-4)
        assert bounds(list(at), spent) == pytest.approx(list(wanted), abs=5e-3)


def crossing(information, limits) -> float:
    """Return the chance that any look leaves its limits, by the multivariate normal."""
    if not len(limits):
        return 0.0
    smaller = np.minimum.outer(information, information)
    larger = np.maximum.outer(information, information)
    cov = np.sqrt(smaller / larger)
    z = multivariate_normal(cov=cov, seed=1)
    return 1 - float(z.cdf(limits, lower_limit=-np.asarray(limits)))


def test_one_look_at_the_end_is_five_percent_and_an_early_end_spends_the_rest():
    for spending in SPENDING:
        assert levels(spending, [60], 60, is_last=True) == [pytest.approx(0.05, abs=1e-5)]
        assert levels(spending, [41], 60, is_last=True) == [pytest.approx(0.05, abs=1e-5)]
        early = levels(spending, [30], 60, is_last=False)
        assert levels(spending, [30, 50], 60, is_last=True)[0] == early[0] < 0.05


def test_a_second_look_at_the_same_people_has_the_same_bound():
    first, again, _last = levels("pocock", [30, 30, 60], 60, is_last=True)
    assert again == pytest.approx(first, rel=1e-6)


def test_more_spread_than_planned_needs_more_people_and_less_never_fewer():
    sd, size = blinded_size([0.0, 20.0] * 10, 8.0, 60)
    assert (round(sd, 2), size) == (10.26, 99)
    assert blinded_size([0.0, 2.0] * 10, 8.0, 60)[1] == 60
