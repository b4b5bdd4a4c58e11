"""Differences between arms, with intervals.

A participant's sessions in an arm become one figure, their mean, and arms are compared over
participants (summary measures: Matthews et al. 1990, BMJ 300:230-235), since strides and sessions
of one person are no independent observations. With as many sessions of each this is what a mixed
model with a random intercept for each participant gives. How often the intervals cover a true
effect in arms of fifteen is counted by `make bench` (docs/internals.md, Studies).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from rehab.studies.analysis.walks import Floats

CONFIDENCE = 0.95
RESAMPLES = 1000
SEED = 1908  # of the bootstrap: the same data give the same interval
MIN_PARTICIPANTS = 3  # of an arm for which an interval is given
# Of an arm that is resampled: of fewer, resamples are too few different ones, and some have hardly
# any spread to divide by.
MIN_RESAMPLED = 6


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate with its 95 % interval; None where there are too few participants for one."""

    estimate: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """How much larger an outcome is in one group than in another.

    Attributes
    ----------
    group, reference
        Their labels.
    participants
        How many of each; of a paired difference twice the pairs.
    paired
        Whether both are of the same people.
    difference
        Of the means, in the outcome's unit.
    effect
        Hedges' g (ratio to the standard deviation between participants).
    """

    group: str
    reference: str
    participants: tuple[int, int]
    paired: bool
    difference: Interval
    effect: Interval | None


def mean_of(values: Sequence[float] | Floats) -> Interval:
    """Return the mean of some participants' figures with Student's interval."""
    figures = np.asarray(values, dtype=float)
    mean = float(figures.mean())
    if len(figures) < MIN_PARTICIPANTS:
        return Interval(mean)
    half = _t(len(figures) - 1) * float(figures.std(ddof=1)) / len(figures) ** 0.5
    return Interval(mean, mean - half, mean + half)


def compare(groups: Mapping[str, Mapping[str, float]], *, paired: bool) -> list[Difference]:
    """Return the differences of all pairs of groups, each later one against each earlier one.

    Parameters
    ----------
    groups
        The figures of each group's participants, by participant.
    paired
        Whether participants walked every arm: only those who did count.
    """
    found = []
    for reference, group in combinations(groups, 2):
        here, there = groups[group], groups[reference]
        if paired:
            both = [one for one in there if one in here]
            here, there = ({one: of[one] for one in both} for of in (here, there))
        if here and there:
            of_group, of_reference = (np.array(list(of.values())) for of in (here, there))
            sizes = len(of_group), len(of_reference)
            effect = _effect(of_group, of_reference, paired=paired)
            interval = mean_of(of_group - of_reference) if paired else welch(of_group, of_reference)
            found.append(Difference(group, reference, sizes, paired, interval, effect))
    return found


def _t(freedom: float) -> float:
    return float(stdtrit(freedom, (1 + CONFIDENCE) / 2))


def welch(a: Floats, b: Floats) -> Interval:
    """Return the difference of two means, whatever their variances (Welch 1947).

    Parameters
    ----------
    a, b
        The figures of each group's participants, shapes (n,) and (m,), in the outcome's unit.
    """
    difference = float(a.mean() - b.mean())
    if min(len(a), len(b)) < MIN_PARTICIPANTS:
        return Interval(difference)
    of_a, of_b = a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)
    error = float(of_a + of_b)
    if error == 0:
        return Interval(difference, difference, difference)
    freedom = error**2 / float(of_a**2 / (len(a) - 1) + of_b**2 / (len(b) - 1))
    half = _t(freedom) * error**0.5
    return Interval(difference, difference - half, difference + half)


def _effect(a: Floats, b: Floats, *, paired: bool) -> Interval | None:
    """Return Hedges' g with the interval of a bootstrap over participants (BCa: Efron 1987).

    None where no spread can be estimated; ``a`` and ``b`` as in `welch`.
    """
    if min(len(a), len(b)) < MIN_PARTICIPANTS or not a.var() + b.var() > 0:
        return None
    from scipy import stats  # takes half a second, which each start of a server would

    correction = 1 - 3 / (4 * (len(a) + len(b) - 2) - 1)  # Hedges 1981

    def g(x: Floats, y: Floats, axis: int = -1) -> Floats:
        spread = np.sqrt((x.var(axis=axis, ddof=1) + y.var(axis=axis, ddof=1)) / 2)
        apart = x.mean(axis=axis) - y.mean(axis=axis)
        return np.asarray(correction * np.divide(apart, np.where(spread > 0, spread, np.inf)))

    estimate = float(g(a, b))
    if min(len(a), len(b)) < MIN_RESAMPLED:
        return Interval(estimate)
    resampled = stats.bootstrap(
        (a, b),
        g,
        paired=paired,
        vectorized=True,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="BCa",
        rng=np.random.default_rng(SEED),
    ).confidence_interval
    low, high = float(resampled.low), float(resampled.high)
    found = np.isfinite([low, high]).all()
    return Interval(estimate, *((low, high) if found else (None, None)))
