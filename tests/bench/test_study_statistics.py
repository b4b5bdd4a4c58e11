"""Type I error, coverage and power of what studies conclude, by numbers alone: 1000 seeds each.

Each scenario says how often its event should happen if all is right; the exact binomial interval of
what was seen has to allow it. People miss the second of two visits at random, or because the first
one went badly (by response: at random given what was seen), or not at random at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import stats

from rehab.studies.analysis.comparison import Difference, carry_over, compare, holm
from rehab.studies.analysis.design_matrix import Observation
from rehab.studies.analysis.sample_size import Assumed, size_of
from rehab.studies.analysis.sequential import blinded_size, levels

SEEDS = range(1000)
CHANCE = 1e-3  # of each scenario to fail with nothing wrong, with that of all about 2 %
EFFECT = 6.0
Random = np.random.Generator


class Event(NamedTuple):
    """Whether something happened in one study, and how often it should: None to be stated only."""

    scenario: str
    happened: bool
    expected: tuple[float, float] | None


def people(
    draw: Random, effect: float, leave: str = "", *, count: int = 40, sites: int = 2
) -> list[Observation]:
    """Return a parallel study: B scatters twice as much, sites differ by 10, two visits."""
    found = []
    for row in range(count):
        arm, site = "AB"[row % 2], draw.integers(sites)
        of_arm = 1.0 + (arm == "B")
        baseline = float(draw.normal(3, 0.5))
        person = 10 * site + 4 * baseline + of_arm * draw.normal(0, 3)
        first, second = person + of_arm * draw.normal(0, 2, 2) + np.array([0.0, 6.0])
        expected = 10 * site + 12
        gone = {
            "": False,
            "at random": draw.random() < 0.4,
            "by response": arm == "B" and first < expected,
            "by itself": arm == "B" and draw.random() < 0.4,
        }[leave]
        if leave == "by itself" and gone:
            second -= 5.0
        for visit, value in enumerate((first, second), 1):
            seen = None if gone and visit == 2 else float(value + effect * (arm == "B"))
            found.append(
                Observation(f"{row}", arm, visit, seen, baseline, strata=(f"site {site}",))
            )
    return found


def crossed(draw: Random, effect: float, leave: str, carried: float = 0.0) -> list[Observation]:
    """Return a crossover of two arms with an effect of the period, and perhaps carry-over."""
    found = []
    for row in range(24):
        order = ("AB", "BA")[row % 2]
        person = draw.normal(0, 6)
        values = person + draw.normal(0, 3, 2) + np.array([0.0, 5.0])
        gone = {"": False, "at random": draw.random() < 0.25, "by response": values[0] < -4}[leave]
        for period, arm in enumerate(order):
            value = values[period] + effect * (arm == "B") + carried * (order == "BA") * period
            seen = None if gone and period else float(value)
            found.append(Observation(f"{row}", arm, period + 1, seen, period=period))
    return found


def one(observed: list[Observation], *, crossover: bool = False) -> Difference:
    [found] = compare(observed, "AB", crossover=crossover).differences
    return found


def covers(found: Difference, true: float) -> bool:
    low, high = found.difference.low, found.difference.high
    assert low is not None
    assert high is not None
    return low <= true <= high


def is_found(found: Difference, level: float = 0.05) -> bool:
    assert found.p is not None
    return found.p < level


def p_of(observed: list[Observation]) -> float:
    """Return p; 1 where few people cannot tell arm and site apart."""
    found = compare(observed, "AB", crossover=False).differences
    return 1.0 if not found or found[0].p is None else found[0].p


def of_design(draw: Random) -> Iterator[Event]:
    """Yield type I error, coverage and power of both designs, with and without dropout."""
    makers: dict[str, tuple[Callable[..., list[Observation]], bool]] = {
        "parallel, strata, unequal variances": (people, False),
        "crossover with period": (crossed, True),
    }
    for name, (make, crossover) in makers.items():
        for leave in ("", "at random", "by response"):
            lost = f"{name}; missing: {leave or 'nothing'}"
            null = one(make(draw, 0.0, leave), crossover=crossover)
            true = one(make(draw, EFFECT, leave), crossover=crossover)
            yield Event(f"{lost}: type I error", is_found(null), (0.045, 0.055))
            yield Event(f"{lost}: coverage", covers(true, EFFECT), (0.945, 0.955))
            yield Event(f"{lost}: power at {EFFECT:g}", is_found(true), None)


def of_response(draw: Random) -> Iterator[Event]:
    """Yield the coverage where half of one arm is missing by response, and people are many."""
    found = one(people(draw, EFFECT, "by response", count=160))
    name = "160 people, parallel; missing: by response: coverage"
    yield Event(name, covers(found, EFFECT), (0.945, 0.955))


def of_clinics(draw: Random) -> Iterator[Event]:
    """Yield the same where ten clinics differ much, and what leaving them out would cost."""
    for effect in (0.0, EFFECT):
        observed = people(draw, effect, "at random", sites=10)
        found = one(observed)
        without = one([replace(row, strata=()) for row in observed])
        name = "ten clinics"
        yield Event(f"{name}: coverage at {effect:g}", covers(found, effect), (0.945, 0.955))
        yield Event(f"{name}: found at {effect:g}", is_found(found), None)
        yield Event(f"{name}: found at {effect:g} without them", is_found(without), None)


def of_margin(draw: Random) -> Iterator[Event]:
    """Yield how often a group that is worse by the margin, or not at all, is "not inferior"."""
    for effect, expected in ((-EFFECT, (0.0225, 0.0275)), (0.0, None)):
        found = one(people(draw, effect, "at random"))
        answer = found.is_not_inferior(EFFECT, higher_is_better=True)
        yield Event(f"non-inferiority, truly {effect:g}", bool(answer), expected)


def of_many(draw: Random) -> Iterator[Event]:
    """Yield how often any of five secondary outcomes without an effect is found."""
    p = [one(people(draw, 0.0, count=24)).p or 0.0 for _ in range(5)]
    yield Event("any of five secondary outcomes, by Holm", min(holm(p)) < 0.05, (0.0, 0.05))
    yield Event("any of five secondary outcomes, uncorrected", min(p) < 0.05, None)


def of_looks(draw: Random) -> Iterator[Event]:
    """Yield how often three looks and the end find something, by spending and without it."""
    for effect in (0.0, EFFECT):
        observed = people(draw, effect, "at random", count=48)
        looks = (12, 24, 36, 48)
        p = [p_of([row for row in observed if int(row.participant) < look]) for look in looks]
        for spending in ("obrien_fleming", "pocock"):
            limits = levels(spending, looks, 48, is_last=True)
            hit = any(
                each is not None and each < limit for each, limit in zip(p, limits, strict=True)
            )
            expected = None if effect else (0.045, 0.055)
            yield Event(f"four looks, {spending}: found at {effect:g}", hit, expected)
        naive = any(each < 0.05 for each in p)
        yield Event(f"four looks, each at 5 %: found at {effect:g}", naive, None)


def of_size(draw: Random) -> Iterator[Event]:
    """Yield type I error and power where the blinded spread of half of them sets the size."""
    for effect in (0.0, 3.0):
        observed = people(draw, effect, count=160, sites=1)
        first: dict[str, list[float]] = {}
        for row in observed:
            if int(row.participant) < 20 and row.value is not None:
                first.setdefault(row.participant, []).append(row.value)
        _sd, size = blinded_size([float(np.mean(each)) for each in first.values()], 4.0, 40)
        size = min(size, 160)
        for name, count in (("as planned", 40), ("by the blinded spread", size)):
            found = one([row for row in observed if int(row.participant) < count])
            expected = None if effect else (0.045, 0.055)
            yield Event(f"size {name}: found at {effect:g}", is_found(found), expected)


def of_missing(draw: Random) -> Iterator[Event]:
    """Yield the coverage where missing values are 5 lower, as they come and with that shift."""
    observed = people(draw, 0.0, "by itself", count=80)
    found = one(observed)
    assert found.missing is not None
    true = -5 * 0.4 / 2  # of the mean over two visits
    yield Event("missing values 5 lower: coverage, if at random", covers(found, true), None)
    sign = 1 if found.difference.estimate > 0 else -1  # a shift goes against the difference
    low, high = found.missing.shifted(5.0 * sign).interval(0.95)
    yield Event(
        "missing values 5 lower: coverage, with that shift", low <= true <= high, (0.945, 0.955)
    )


def of_carry_over(draw: Random) -> Iterator[Event]:
    """Yield how often carry-over is found, without any and of 8."""
    for carried, expected in ((0.0, (0.045, 0.055)), (8.0, None)):
        [found] = carry_over(crossed(draw, EFFECT, "", carried), "AB")
        yield Event(f"carry-over of {carried:g} found", is_found(found), expected)


def of_planned(draw: Random) -> Iterator[Event]:
    """Yield the power of as many people as the formula asks for, by the model of the results."""
    for power in (0.8, 0.9):
        assumed = Assumed(difference=8.0, sd=10.0, power=power, correlation=0.5)
        for name, walked in (("parallel", 1), ("crossover", 2)):
            finish = size_of(assumed, (1, 1), walked=walked).finish
            found = []
            for row in range(finish):
                person = draw.normal(0, 10 * 0.5**0.5)
                for period in range(walked):
                    arm = "AB"[(row + period) % 2]
                    value = person + draw.normal(0, 10 * 0.5**0.5) + 8 * (arm == "B")
                    found.append(Observation(f"{row}", arm, period + 1, value, period=period))
            event = f"{name}, {finish} people by the formula: power at {power:.0%}"
            hit = is_found(one(found, crossover=walked > 1))
            yield Event(event, hit, (power - 0.01, power + 0.05))  # whole blocks: rather more


def studied(seed: int) -> list[Event]:
    """Return what happened in the studies of a seed."""
    draw = np.random.default_rng([38, seed])
    parts = (
        of_design,
        of_response,
        of_clinics,
        of_margin,
        of_many,
        of_looks,
        of_size,
        of_missing,
        of_carry_over,
        of_planned,
    )
    return [event for part in parts for event in part(draw)]


def test_errors_coverage_and_power_are_what_they_should_be():
    with ProcessPoolExecutor(2) as processes:
        events = [one for many in processes.map(studied, SEEDS, chunksize=10) for one in many]
    found: dict[str, list[bool]] = {}
    allowed = {event.scenario: event.expected for event in events}
    for event in events:
        found.setdefault(event.scenario, []).append(event.happened)
    print("\n| scenario | studies | share | exact 95 % interval |\n|---|---|---|---|")
    wrong = []
    for scenario, happened in found.items():
        count, hits = len(happened), sum(happened)
        exact = stats.binomtest(hits, count)
        low, high = exact.proportion_ci(0.95, method="exact")
        print(f"| {scenario} | {count} | {hits / count:.1%} | {low:.1%} … {high:.1%} |")
        wide_low, wide_high = exact.proportion_ci(1 - CHANCE, method="exact")
        expected = allowed[scenario]
        if expected is not None and not (wide_low <= expected[1] and wide_high >= expected[0]):
            wrong.append(scenario)
    assert wrong == []
    share = {scenario: np.mean(happened) for scenario, happened in found.items()}
    # The bench detects: what is done without a correction is far off.
    assert share["four looks, each at 5 %: found at 0"] > 0.09
    assert share["any of five secondary outcomes, uncorrected"] > 0.15
    assert share["missing values 5 lower: coverage, if at random"] < 0.93
    assert share["ten clinics: found at 6"] > share["ten clinics: found at 6 without them"] + 0.1
