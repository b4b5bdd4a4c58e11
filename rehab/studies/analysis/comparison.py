"""Differences between arms, with intervals: one model for each outcome.

A mixed model (`mixed_model`) of all visits that were walked, adjusted for the visit, the first
baseline and the strata of the allocation, with variances of each arm's own: who misses a visit at
random, or because of what was seen before, shifts nothing. In a crossover arms are compared within
people, adjusted for the visit and with it the period. Bias, coverage, type I error and power:
`tests/bench/test_study_bias.py`, `test_study_statistics.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from rehab.studies.analysis import design_matrix
from rehab.studies.analysis.design_matrix import MIN_PARTICIPANTS, Design, Observation
from rehab.studies.analysis.mixed_model import Estimate, Floats
from rehab.studies.analysis.tipping_point import Missing, missing_of

CONFIDENCE = 0.95


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

    def within(self, least: float, most: float) -> Interval:
        """Return the same cut at the bounds that a value can have."""
        ends = (
            None if end is None else min(max(end, least), most) for end in (self.low, self.high)
        )
        return Interval(self.estimate, *ends)


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
    estimate
        What the interval was made of; None where there are too few participants for one.
    missing
        What visits that are missing could do to it; None where none is.
    """

    group: str
    reference: str
    participants: tuple[int, int]
    paired: bool
    difference: Interval
    effect: Interval | None
    estimate: Estimate | None = None
    missing: Missing | None = None

    @property
    def sd(self) -> float | None:
        """The standard deviation between participants that the effect is a ratio to."""
        if self.effect is None or not self.effect.estimate:
            return None
        return self.difference.estimate / self.effect.estimate * small_sample(*self.participants)

    @property
    def p(self) -> float | None:
        """Two-sided p of no difference, of this comparison alone."""
        return None if self.estimate is None else self.estimate.p

    def tipping_point(self, adjusted: float | None, level: float | None) -> float | None:
        """Return the least shift of missing visits at which p by Holm is above a level.

        Parameters
        ----------
        adjusted, level
            p by Holm, None of a comparison alone; below which it is found, None for 5 %.
        """
        if self.missing is None or self.p is None:
            return None
        share = self.p / adjusted if adjusted else 1.0  # of the level, that Holm leaves it
        return self.missing.tipping_point(1 - share * (level or 1 - CONFIDENCE))

    def is_not_inferior(
        self, margin: float, *, higher_is_better: bool, confidence: float = CONFIDENCE
    ) -> bool | None:
        """Return whether the interval leaves out that the group is worse by a margin.

        None without an interval. The lower end of a two-sided 95 % interval is a one-sided test at
        2.5 % (ICH E9, 3.3.2; CONSORT extension, Piaggio 2012, JAMA 308:2594-2604).

        Parameters
        ----------
        margin
            By how much the group may be worse, in the outcome's unit; positive.
        higher_is_better
            Of the outcome.
        confidence
            Of the interval (ratio).
        """
        if self.estimate is None:
            return None
        low, high = self.estimate.interval(confidence)
        return low > -margin if higher_is_better else high < margin


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
        All of an outcome, in any order, also those that are missing.
    arms
        The codes of the arms; those without observations are left out.
    crossover
        Whether everybody walks every arm.
    """
    walked = _walked(observations, arms)
    if not walked:
        return Comparison({}, ())
    make = design_matrix.crossover if crossover else design_matrix.parallel
    return _compare(make(observations, walked), observations, paired=crossover)


def carry_over(observations: Sequence[Observation], arms: Sequence[str]) -> tuple[Difference, ...]:
    """Return by how much more each arm of a crossover adds to the next period than an earlier one.

    The comparison of arms is not chosen by it (Freeman 1989, Statistics in Medicine 8:1421-1432):
    of two arms it is between people, and too weak to show that there is none.

    Parameters
    ----------
    observations, arms
        As for `compare`.
    """
    walked = _walked(observations, arms)
    if len({one.period for one in observations if one.value is not None}) < 2:
        return ()
    design = design_matrix.crossover(observations, walked, carry_over=True)
    found = _compare(design, observations, paired=False)
    return tuple(replace(one, effect=None, missing=None) for one in found.differences)


def holm(p: Sequence[float]) -> list[float]:
    """Return p adjusted for their number, in their order (Holm 1979, Scand J Statist 6:65-70)."""
    order = sorted(range(len(p)), key=lambda index: p[index])
    adjusted, most = [0.0] * len(p), 0.0
    for rank, index in enumerate(order):
        most = max(most, min(1.0, (len(p) - rank) * p[index]))
        adjusted[index] = most
    return adjusted


def _walked(observations: Sequence[Observation], arms: Sequence[str]) -> list[str]:
    have = {one.arm for one in observations if one.value is not None}
    return [arm for arm in arms if arm in have]


def _compare(design: Design, observations: Sequence[Observation], *, paired: bool) -> Comparison:
    fitted, weights = design.fit, design.weights
    people = {arm: _means(observations, arm) for arm in design.arms}
    means = {
        arm: _interval(fitted.estimate(weights[arm]), len(people[arm]))
        for arm in design.arms
        if arm in weights and fitted.tells(weights[arm])
    }
    differences = []
    for reference, group in combinations(design.arms, 2):
        if group not in weights or reference not in weights:
            continue
        apart = weights[group] - weights[reference]
        if fitted.tells(apart):
            sizes = len(people[group]), len(people[reference])
            estimate = fitted.estimate(apart)
            found = _interval(estimate, min(sizes))
            effect = _effect(found, people[group], people[reference])
            has_ends = found.low is not None
            missing = missing_of(design, group, reference, estimate) if has_ends else None
            with_ends = estimate if has_ends else None
            differences.append(
                Difference(group, reference, sizes, paired, found, effect, with_ends, missing)
            )
    return Comparison(means, tuple(differences))


def _means(observations: Sequence[Observation], arm: str) -> Floats:
    """Return each participant's mean in an arm, shape (n,)."""
    of_person: dict[str, list[float]] = {}
    for one in observations:
        if one.arm == arm and one.value is not None:
            of_person.setdefault(one.participant, []).append(one.value)
    return np.array([sum(values) / len(values) for values in of_person.values()])


def _interval(found: Estimate, participants: int) -> Interval:
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
    return difference.times(small_sample(len(a), len(b)) / spread)


def small_sample(a: int, b: int) -> float:
    """Return Hedges' correction of two groups of ``a`` and ``b`` people."""
    return 1 - 3 / (4 * (a + b - 2) - 1)
