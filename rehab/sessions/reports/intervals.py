"""Means with their confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import stdtrit

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class MeanInterval:
    """A mean with its confidence interval, in the unit of its values.

    ``low`` and ``high`` are None for fewer than two values: one value has no spread.
    """

    count: int
    mean: float
    low: float | None
    high: float | None


def mean_interval(
    values: Sequence[float], bounds: tuple[float, float] = (-math.inf, math.inf)
) -> MeanInterval | None:
    """Return the mean of independent values with Student's t interval; None without a value.

    The interval is mean ± t(0.975, n − 1) · s / √n (Student, "The probable error of a mean",
    Biometrika 6, 1908), cut off at the bounds of what the values can be.
    """
    count = len(values)
    if not count:
        return None
    mean = math.fsum(values) / count
    if count < 2:
        return MeanInterval(count, mean, None, None)
    deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (count - 1))
    half = float(stdtrit(count - 1, (1 + CONFIDENCE) / 2)) * deviation / math.sqrt(count)
    low, high = bounds
    return MeanInterval(count, mean, max(low, mean - half), min(high, mean + half))
