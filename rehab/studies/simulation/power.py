"""Power by simulation: how often studies would find an effect that is truly there."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass
from typing import NamedTuple

from rehab.studies.analysis.comparison import CONFIDENCE
from rehab.studies.simulation.trial import Trial, differences, simulate


class SimulatedDifference(NamedTuple):
    """What one simulated study found of a pair of arms: the difference with its interval."""

    group: str
    reference: str
    estimate: float
    low: float | None
    high: float | None


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
        Share of intervals without zero (ratio), with its own 95 % interval.
    estimate
        Mean difference that was found, in the outcome's unit.
    """

    group: str
    reference: str
    studies: int
    power: float
    low: float
    high: float
    estimate: float


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
            SimulatedDifference(one.group, one.reference, *astuple(one.difference))
            for one in differences(trial, simulate(trial, seed))
        ]
        if time.monotonic() - began >= every_s:
            yield batch
            batch, began = {}, time.monotonic()
    if batch:
        yield batch


def summarize(found: Sequence[SimulatedDifference]) -> list[PairPower]:
    """Return the power for each pair of arms, in the order in which they were found."""
    pairs = dict.fromkeys((one.group, one.reference) for one in found)
    return [_power(group, reference, found) for group, reference in pairs]


def _power(group: str, reference: str, found: Sequence[SimulatedDifference]) -> PairPower:
    mine = [one for one in found if (one.group, one.reference) == (group, reference)]
    hits = sum(
        one.low is not None and one.high is not None and (one.low > 0 or one.high < 0)
        for one in mine
    )
    low, high = wilson(hits, len(mine))
    estimate = sum(one.estimate for one in mine) / len(mine)
    return PairPower(group, reference, len(mine), hits / len(mine), low, high, estimate)


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of the share ``hits`` / ``count`` (Wilson 1927, JASA 22:209-212)."""
    from scipy.stats import binomtest  # takes half a second, which each start of a server would

    interval = binomtest(hits, count).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
