"""Bias, coverage and type I error of a study's primary effect where people miss visits.

Studies are simulated whole, and then lose visits: so the same people show what is lost by missing.
Beside the model stands what was reported before it: Welch's interval of each participant's mean of
whatever visits there are, and retention as a share of the gain.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import stats

from rehab.studies.allocation.groups_and_strata import Group
from rehab.studies.analysis.comparison import compare
from rehab.studies.analysis.design_matrix import Observation
from rehab.studies.analysis.findings import observations
from rehab.studies.analysis.participants import Participant, ParticipantVisit, by_arm
from rehab.studies.simulation.example import PHASES
from rehab.studies.simulation.trial import Trial, simulate
from rehab.training.goals import GoalRule
from rehab.training.measures import A2
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import find_valence

SEEDS = range(500)
CROSSED = 1000
PEOPLE, ARMS = 24, ("A", "B")
# Of an estimate's own scatter: so much bias takes less than 1 % of the coverage. Where missing
# follows the response, the correlation between visits is estimated from few people: the bias goes
# with their number, so of `MANY` people less is left.
LEFT, LEFT_OF_MANY, MANY = 0.25, 0.15, 64
EFFECT = 8.0  # of arm B, in percent of the baseline; washout keeps a quarter
OUTCOME, WASHOUT, SHARE = "training_change", "washout_change", "retention_in_washout"


class Found(NamedTuple):
    """What one study found: scenario, method, estimate less the truth, and whether it covers it."""

    scenario: str
    method: str
    off: float
    covers: bool


def trial_with(effect: float) -> Trial:
    plan = SessionPlan(
        measure=A2,
        valence=find_valence("positive"),
        phases=PHASES,
        trained_side=Side.LEFT,
        goal=GoalRule(percent_of_baseline=100),
    )
    return Trial(
        plans=dict.fromkeys(ARMS, plan),
        effects={"A": 0.0, "B": effect},
        groups=tuple(Group((arm,)) for arm in ARMS),
        participants=PEOPLE,
        outcome=OUTCOME,
        visits=2,
    )


def lose_second_visits(people: Sequence[Participant], who: set[str]) -> list[Participant]:
    """Return the same people, some without what they walked at the second visit."""
    return [
        replace(one, visits=(one.visits[0], ParticipantVisit(2, one.visits[1].arm)))
        if one.code in who
        else one
        for one in people
    ]


def nobody(_people: list[Participant], _seed: int) -> list[Participant]:
    return []


def half_at_random(people: list[Participant], seed: int) -> list[Participant]:
    return random.Random(seed).sample(people, len(people) // 2)


def the_worse_half(people: list[Participant], _seed: int) -> list[Participant]:
    return sorted(people, key=lambda one: one.visits[0].outcomes[OUTCOME])[: len(people) // 2]


LEAVE: dict[str, Callable[[list[Participant], int], list[Participant]]] = {
    "everybody comes": nobody,
    "half of B misses visit 2, at random": half_at_random,
    "the half of B that gained less misses visit 2": the_worse_half,
}


def studied(seed: int) -> list[Found]:
    """Return what each method finds of two studies of a seed, without and with an effect."""
    found = []
    for effect in (0.0, EFFECT):
        whole = simulate(trial_with(effect), seed)
        in_b = [one for one in whole if one.arms == ("B",)]
        for leave, choose in LEAVE.items():
            people = lose_second_visits(whole, {one.code for one in choose(in_b, seed)})
            scenario = f"effect {effect:g}, {leave}"
            for slug, true in ((OUTCOME, effect), (WASHOUT, effect / 4)):
                found += list(both_methods(people, slug, true, f"{scenario}: {slug}"))
        shares = shares_of_gain(whole)
        if shares is not None:
            found.append(Found(f"effect {effect:g}: {SHARE}, B - A", "before", shares, True))
    return found


def both_methods(
    people: list[Participant], slug: str, true: float, scenario: str
) -> Iterator[Found]:
    groups = by_arm(people, ARMS, slug)
    a, b = (np.array(list(groups[arm].values())) for arm in ARMS)
    low, high = stats.ttest_ind(b, a, equal_var=False).confidence_interval(0.95)
    yield Found(scenario, "before", b.mean() - a.mean() - true, bool(low <= true <= high))
    [one] = compare(observations(people, slug), ARMS, crossover=False).differences
    interval = one.difference
    covers = interval.low <= true <= interval.high
    yield Found(scenario, "now", interval.estimate - true, covers)


def shares_of_gain(people: list[Participant]) -> float | None:
    """Return by how much shares of the gain that washout kept differ, of those who gained 3 %.

    Arm B keeps the effect's quarter more of the baseline; the share says the opposite.
    """
    means: dict[str, list[float]] = {arm: [] for arm in ARMS}
    for one in people:
        for visit in one.visits:
            gained, kept = visit.outcomes[OUTCOME], visit.outcomes[WASHOUT]
            if gained >= 3:
                means[visit.arm].append(100 * kept / gained)
    return float(np.mean(means["B"]) - np.mean(means["A"])) if all(means.values()) else None


def crossed(draw: np.random.Generator, lost: str, count: int = 16) -> list[Found]:
    """Return what is found of one crossover of numbers alone, with an effect of the period."""
    values = draw.normal(0, 6, (count, 1)) + draw.normal(0, 3, (count, 2)) + np.array([0.0, 8.0])
    orders = [("A", "B"), ("B", "A")] * (count // 2)
    gone = {row for row in range(count) if lost != "nobody" and row % 2 and values[row, 0] < 0}
    observed = [
        Observation(f"{row}", orders[row][visit], visit + 1, float(values[row, visit]), None, visit)
        for row in range(count)
        for visit in range(2)
        if visit == 0 or row not in gone
    ]
    whole = [row for row in range(count) if row not in gone]
    apart = [
        values[row][orders[row].index("B")] - values[row][orders[row].index("A")] for row in whole
    ]
    low, high = stats.ttest_1samp(apart, 0).confidence_interval(0.95)
    [one] = compare(observed, ARMS, crossover=True).differences
    interval = one.difference
    name = f"crossover of {count}, effect 0, {lost} of BA with a bad first period misses the second"
    return [
        Found(name, "before", float(np.mean(apart)), bool(low <= 0 <= high)),
        Found(name, "now", interval.estimate, interval.low <= 0 <= interval.high),
    ]


def test_effects_are_unbiased_and_covered_where_visits_are_missing_at_random():
    with ProcessPoolExecutor(2) as processes:
        found = [one for many in processes.map(studied, SEEDS, chunksize=5) for one in many]
    draw = np.random.default_rng(38)
    for lost in ("nobody", "everybody"):
        found += [one for _ in range(CROSSED) for one in crossed(draw, lost)]
    found += [one for _ in range(CROSSED) for one in crossed(draw, "everybody", MANY)]
    rows: dict[tuple[str, str], list[Found]] = defaultdict(list)
    for one in found:
        rows[one.scenario, one.method].append(one)
    print("\n| scenario | method | studies | bias (SE) | coverage |\n|---|---|---|---|---|")
    for (scenario, method), of_row in rows.items():
        off = np.array([one.off for one in of_row])
        covered = np.mean([one.covers for one in of_row])
        error = off.std(ddof=1) / len(off) ** 0.5
        told = "" if SHARE in scenario else f"{covered:.1%}"
        print(f"| {scenario} | {method} | {len(off)} | {off.mean():+.2f} ({error:.2f}) | {told} |")
        if method == "now":
            left = LEFT_OF_MANY if f"crossover of {MANY}" in scenario else LEFT
            assert abs(off.mean()) < left * off.std(ddof=1), scenario
            exact = stats.binomtest(int(sum(one.covers for one in of_row)), len(of_row), 0.95)
            assert exact.pvalue > 1e-3, scenario
    worst = [
        np.mean([one.off for one in rows[f"effect 0, {leave}: {OUTCOME}", "before"]])
        for leave in LEAVE
    ]
    assert max(map(abs, worst)) > 2  # the bench detects
