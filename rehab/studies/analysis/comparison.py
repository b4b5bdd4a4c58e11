"""Differences between arms, with intervals: one model for each outcome.

A mixed model (`mixed_model`) of all visits that were walked, adjusted for the visit and the first
baseline, so that who misses a visit at random, or because of what was seen before, shifts nothing.
In parallel groups each arm has a mean of its own at each visit, and arms are compared in the mean
over the visits that all of them walked, each with the same weight. In a crossover arms are compared
within people, adjusted for the visit and with it the period. Bias, coverage and type I error:
`tests/bench/test_study_bias.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from rehab.studies.analysis.mixed_model import Fit, fit
from rehab.studies.analysis.walks import Floats

CONFIDENCE = 0.95
MIN_PARTICIPANTS = 3  # of an arm for which an interval is given


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate with its 95 % interval; None where there are too few participants for one."""

    estimate: float
    low: float | None = None
    high: float | None = None

    def times(self, factor: float) -> Interval:
        """Return the same in another unit. ``factor``: positive."""
        low, high = (None if end is None else factor * end for end in (self.low, self.high))
        return Interval(factor * self.estimate, low, high)


@dataclass(frozen=True, slots=True)
class Observation:
    """An outcome of one visit.

    Attributes
    ----------
    participant, arm, visit
        Whose, in which arm, at which visit, counted from 1 over all periods.
    period
        Of a crossover, from 0.
    value, baseline
        The outcome, and the participant's first baseline; None where that is unknown.
    """

    participant: str
    arm: str
    visit: int
    value: float
    baseline: float | None = None
    period: int = 0


@dataclass(frozen=True, slots=True)
class Difference:
    """How much larger an outcome is in one group than in another.

    Attributes
    ----------
    group, reference
        Their labels.
    participants
        How many of each have the outcome.
    paired
        Whether people walked both.
    difference
        Of the means, in the outcome's unit.
    effect
        The same difference and interval as a ratio to the standard deviation between participants
        (Hedges' g, with his correction for small groups).
    """

    group: str
    reference: str
    participants: tuple[int, int]
    paired: bool
    difference: Interval
    effect: Interval | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """An outcome over all arms: the model's mean of each arm that has one, and the differences."""

    means: Mapping[str, Interval]
    differences: tuple[Difference, ...]


def mean_of(values: Sequence[float] | Floats) -> Interval:
    """Return the mean of some participants' figures with Student's interval."""
    figures = np.asarray(values, dtype=float)
    mean = float(figures.mean())
    if len(figures) < MIN_PARTICIPANTS:
        return Interval(mean)
    freedom = len(figures) - 1
    error = float(figures.std(ddof=1)) / len(figures) ** 0.5
    half = float(stdtrit(freedom, (1 + CONFIDENCE) / 2)) * error
    return Interval(mean, mean - half, mean + half)


def compare(
    observations: Sequence[Observation], arms: Sequence[str], *, crossover: bool
) -> Comparison:
    """Return the means of arms, and the difference of each later arm to each earlier one.

    Parameters
    ----------
    observations
        All that were made of an outcome, in any order.
    arms
        The codes of the arms; those without observations are left out.
    crossover
        Whether everybody walks every arm.
    """
    walked = [arm for arm in arms if any(one.arm == arm for one in observations)]
    if not walked:
        return Comparison({}, ())
    weights, fitted = (
        _fit_crossover(observations, walked) if crossover else _fit_parallel(observations, walked)
    )
    people = {arm: _means(observations, arm) for arm in walked}
    means = {
        arm: _interval(fitted, weights[arm], len(people[arm]))
        for arm in walked
        if arm in weights and fitted.tells(weights[arm])
    }
    differences = []
    for reference, group in combinations(walked, 2):
        if group not in weights or reference not in weights:
            continue
        apart = weights[group] - weights[reference]
        if fitted.tells(apart):
            sizes = len(people[group]), len(people[reference])
            found = _interval(fitted, apart, min(sizes))
            effect = _effect(found, people[group], people[reference])
            paired = crossover
            differences.append(Difference(group, reference, sizes, paired, found, effect))
    return Comparison(means, tuple(differences))


def _means(observations: Sequence[Observation], arm: str) -> Floats:
    """Return each participant's mean in an arm, shape (n,)."""
    of_person: dict[str, list[float]] = {}
    for one in observations:
        if one.arm == arm:
            of_person.setdefault(one.participant, []).append(one.value)
    return np.array([sum(values) / len(values) for values in of_person.values()])


def _interval(fitted: Fit, weights: Floats, participants: int) -> Interval:
    found = fitted.estimate(weights)
    if participants < MIN_PARTICIPANTS or found.freedom < 1:
        return Interval(found.value)
    return Interval(found.value, *found.interval(CONFIDENCE))


def _effect(difference: Interval, a: Floats, b: Floats) -> Interval | None:
    """Return a difference as Hedges' g (1981); None where no spread can be estimated.

    Its interval is the difference's own, so that both exclude zero or neither does.
    """
    if min(len(a), len(b)) < MIN_PARTICIPANTS:
        return None
    spread = float(((a.var(ddof=1) + b.var(ddof=1)) / 2) ** 0.5)
    if not spread > 0:
        return None
    return difference.times((1 - 3 / (4 * (len(a) + len(b) - 2) - 1)) / spread)


def _fit_parallel(
    observations: Sequence[Observation], arms: Sequence[str]
) -> tuple[dict[str, Floats], Fit]:
    """Return each arm's weights of the effects, and the fit with an effect of each arm's visit."""
    cells = sorted({(one.arm, one.visit) for one in observations})
    place = {cell: index for index, cell in enumerate(cells)}
    common = [
        visit
        for visit in sorted({one.visit for one in observations})
        if all((arm, visit) in place for arm in arms)
    ]
    table = _Table(observations, len(cells) + 1)
    for person, column, one in table.places():
        table.x[person, column, place[one.arm, one.visit]] = 1.0
        table.x[person, column, -1] = table.baselines[person]
    weights = {arm: np.zeros(len(cells) + 1) for arm in arms if common}
    for arm, of_arm in weights.items():
        of_arm[[place[arm, visit] for visit in common]] = 1 / len(common)
    return weights, fit(table.x, table.y, table.seen, np.ones((1, *table.y.shape[1:] * 2)))


def _fit_crossover(
    observations: Sequence[Observation], arms: Sequence[str]
) -> tuple[dict[str, Floats], Fit]:
    """Return each arm's weights of the effects, and the fit with effects of arms and of visits."""
    table = _Table(observations, len(arms) + len({one.visit for one in observations}) - 1)
    last = table.y.shape[1] - 1
    periods = np.zeros(last + 1)
    for person, column, one in table.places():
        row = table.x[person, column]
        row[arms.index(one.arm)] = 1.0
        if column == last:  # visits' effects sum to 0
            row[len(arms) :] = -1.0
        else:
            row[len(arms) + column] = 1.0
        periods[column] = one.period
    weights = {arm: np.eye(table.x.shape[2])[index] for index, arm in enumerate(arms)}
    alike = np.array([np.ones((last + 1, last + 1)), periods[:, None] == periods[None, :]])
    return weights, fit(table.x, table.y, table.seen, alike.astype(float))


class _Table:
    """Observations as arrays: a row for each participant, a column for each visit."""

    def __init__(self, observations: Sequence[Observation], effects: int) -> None:
        self._observations = observations
        people = dict.fromkeys(one.participant for one in observations)
        self._rows = {person: row for row, person in enumerate(people)}
        visits = sorted({one.visit for one in observations})
        self._columns = {visit: column for column, visit in enumerate(visits)}
        shape = len(people), len(visits)
        self.x = np.zeros((*shape, effects))
        self.y = np.zeros(shape)
        self.seen = np.zeros(shape, bool)
        self.baselines = np.full(shape[0], np.nan)
        for row, column, one in self.places():
            self.y[row, column], self.seen[row, column] = one.value, True
            if one.baseline is not None:
                self.baselines[row] = one.baseline
        self.baselines = _standardize(self.baselines)

    def places(self) -> list[tuple[int, int, Observation]]:
        """Return row and column of each observation."""
        rows, columns = self._rows, self._columns
        return [(rows[one.participant], columns[one.visit], one) for one in self._observations]


def _standardize(baselines: Floats) -> Floats:
    """Return baselines about 0 with a spread of 1, unknown ones at 0; all 0 without a spread.

    The mean in place of a baseline that is missing keeps a randomized comparison unbiased (White
    and Thompson 2005, Statistics in Medicine 24:993-1007).
    """
    known = np.isfinite(baselines)
    if known.sum() < 2 or not (spread := float(baselines[known].std())) > 0:
        return np.zeros_like(baselines)
    return np.where(known, (baselines - baselines[known].mean()) / spread, 0.0)
