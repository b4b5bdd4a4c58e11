"""Power by simulation: how often studies would find an effect that is truly there."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import NamedTuple

from rehab.studies.analysis.comparison import CONFIDENCE
from rehab.studies.simulation.trial import Trial, differences, simulate


class SimulatedDifference(NamedTuple):
    """What one simulated study found of a pair of arms: the difference, its interval, the spread.

    ``sd``: between people of an arm, of the mean of their visits.
    """

    group: str
    reference: str
    estimate: float
    low: float | None
    high: float | None
    sd: float | None = None


@dataclass(frozen=True, slots=True)
class PairPower:
    """How often an effect was found.

    Attributes
    ----------
    group, reference
        Codes of the arms.
    studies
        How many were simulated.
    power, low, high
        Share of studies that found it (ratio), with its own 95 % interval.
    estimate
        Mean difference that was found, in the outcome's unit.
    sd
        How people differed, in the same unit; None where that was not stored.
    """

    group: str
    reference: str
    studies: int
    power: float
    low: float
    high: float
    estimate: float
    sd: float | None = None


def simulate_from(
    trial: Trial, seeds: Iterable[int], every_s: float
) -> Iterator[dict[int, list[SimulatedDifference]]]:
    """Yield what the studies of some seeds found, by seed.

    Parameters
    ----------
    trial, seeds
        The study, and the seed of each time that it is simulated.
    every_s
        After about how much work found differences are yielded [s]; the rest come at the end.
    """
    batch: dict[int, list[SimulatedDifference]] = {}
    began = time.monotonic()
    for seed in seeds:
        batch[seed] = [
            SimulatedDifference(
                one.group, one.reference, found.estimate, found.low, found.high, one.sd
            )
            for one in differences(trial, simulate(trial, seed))
            for found in [one.difference]
        ]
        if time.monotonic() - began >= every_s:
            yield batch
            batch, began = {}, time.monotonic()
    if batch:
        yield batch


def summarize(
    found: Sequence[SimulatedDifference],
    margin: float | None = None,
    *,
    higher_is_better: bool = True,
) -> list[PairPower]:
    """Return the power for each pair of arms, in the order in which they were found.

    Parameters
    ----------
    found
        What the simulated studies found.
    margin, higher_is_better
        Of non-inferiority, in the outcome's unit: then power is to find that a group is not worse
        by it; None to find any difference. The direction of the outcome.
    """
    pairs = dict.fromkeys((one.group, one.reference) for one in found)

    def is_found(one: SimulatedDifference) -> bool:
        if one.low is None or one.high is None:
            return False
        if margin is None:
            return one.low > 0 or one.high < 0
        return one.low > -margin if higher_is_better else one.high < margin

    return [_power(group, reference, found, is_found) for group, reference in pairs]


def _power(
    group: str,
    reference: str,
    found: Sequence[SimulatedDifference],
    is_found: Callable[[SimulatedDifference], bool],
) -> PairPower:
    mine = [one for one in found if (one.group, one.reference) == (group, reference)]
    hits = sum(map(is_found, mine))
    low, high = wilson(hits, len(mine))
    estimate = sum(one.estimate for one in mine) / len(mine)
    spreads = [one.sd for one in mine if one.sd is not None]
    sd = math.sqrt(fmean(each**2 for each in spreads)) if spreads else None
    return PairPower(group, reference, len(mine), hits / len(mine), low, high, estimate, sd)


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of the share ``hits`` / ``count`` (Wilson 1927, JASA 22:209-212)."""
    from scipy.stats import binomtest  # takes half a second, which each start of a server would

    interval = binomtest(hits, count).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
