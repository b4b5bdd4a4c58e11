"""How many participants a study needs, by the t test: at once, before anything is simulated.

Julious 2004 (Statistics in Medicine 23:1921-1986), with the noncentral t distribution: two groups
in parallel, or a crossover, whose differences within people are compared. The model of the results
also adjusts for the first baseline, so that it is rather too large than too small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import nctdtr, stdtrit

from rehab.training.measures import InvalidSetting

ALPHA = 0.05  # two-sided, as results are told
PARTICIPANTS_MAX = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumed:
    """What a size rests on.

    Attributes
    ----------
    difference
        Between arms, that shall be found; or the margin of non-inferiority, with arms alike.
    sd
        Between people, in the same unit.
    power
        Chance to find it (ratio).
    dropout
        Share of the participants who give no outcome (ratio).
    correlation
        Between a person's outcomes in two arms, of a crossover.

    Raises
    ------
    InvalidSetting
        For values out of bounds.
    """

    difference: float
    sd: float
    power: float = 0.8
    dropout: float = 0.1
    correlation: float = 0.5

    def __post_init__(self) -> None:
        if not (self.difference and self.sd > 0):
            raise InvalidSetting("Difference and SD are numbers above 0.")
        if not (0.5 <= self.power <= 0.99 and 0 <= self.dropout <= 0.9):
            raise InvalidSetting("Give a power of 50 to 99 %, and 0 to 90 % who leave.")
        if not 0 <= self.correlation <= 0.99:
            raise InvalidSetting("The correlation within people is 0 to 0.99.")


@dataclass(frozen=True, slots=True)
class Size:
    """How many ``finish`` with the outcome, how many are ``enrolled``, at which ``alpha``."""

    finish: int
    enrolled: int
    alpha: float


def power_of(difference: float, error: float, freedom: float, alpha: float = ALPHA) -> float:
    """Return the chance that a two-sided t test finds a difference.

    Parameters
    ----------
    difference, error
        The true difference and its standard error, in one unit.
    freedom, alpha
        Degrees of freedom; the level of the test.
    """
    bound = stdtrit(freedom, 1 - alpha / 2)
    shift = abs(difference) / error
    return float(1 - nctdtr(freedom, shift, bound) + nctdtr(freedom, shift, -bound))


def size_of(assumed: Assumed, weights: Sequence[int], *, walked: int = 1) -> Size:
    """Return how many participants are needed, in whole blocks of the ratio.

    Of several arms each pair is tested at alpha / pairs, as the first step of Holm's would.

    Parameters
    ----------
    assumed
        What is assumed.
    weights
        Each group's part of the ratio, of at least two.
    walked
        How many arms everybody walks: all of a crossover, else 1.

    Raises
    ------
    InvalidSetting
        For a size beyond any study.
    """
    share, (low, next_low, *_more) = sum(weights), sorted(weights)
    alpha = ALPHA / math.comb(walked if walked > 1 else len(weights), 2)
    for blocks in range(1, PARTICIPANTS_MAX // share + 1):
        people = blocks * share
        if walked > 1:
            variance = 2 * (1 - assumed.correlation) / people
            freedom = (people - 2) * (walked - 1)
        else:
            variance = 1 / (blocks * low) + 1 / (blocks * next_low)
            freedom = blocks * (low + next_low) - 2
        error = assumed.sd * math.sqrt(variance)
        if freedom < 1 or power_of(assumed.difference, error, freedom, alpha) < assumed.power:
            continue
        enrolled = math.ceil(people / (1 - assumed.dropout) / share - 1e-9) * share
        return Size(people, enrolled, alpha)
    raise InvalidSetting(
        "More than {most} participants would be needed. Look for a larger difference, or an "
        "outcome in which people differ less.",
        most=PARTICIPANTS_MAX,
    )
