"""Whether a study's 95 % intervals cover the true effect as often as they say."""

from __future__ import annotations

from collections import Counter

import pytest

from rehab.studies.simulation.example import example_trial
from rehab.studies.simulation.trial import differences, simulate

SEEDS = 1000


@pytest.mark.timeout(7200)
def test_intervals_cover_the_effect_that_was_put_in():
    trial = example_trial()
    covered: Counter[str] = Counter()
    for seed in range(SEEDS):
        for found in differences(trial, simulate(trial, seed)):
            true = trial.effects[found.group] - trial.effects[found.reference]
            interval = found.difference
            covered[f"{found.group} - {found.reference}"] += interval.low <= true <= interval.high
    shares = {pair: count / SEEDS for pair, count in sorted(covered.items())}
    print(shares)
    assert len(shares) == 6
    assert all(0.93 <= share <= 0.97 for share in shares.values())
