"""Whether blinding held: indices of what people guess about their group at the end. Pure.

James KE et al., Stat Med 1996;15:1421-34: one index of all groups, 0 where every guess is right,
0.5 where guesses are as good as chance, 1 where nobody knows. Bang H et al., Control Clin Trials
2004;25:143-56: one of each of two groups, 1 where all guess right, 0 by chance, -1 where all guess
the other group.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtri

from rehab.studies.analysis.comparison import CONFIDENCE, Interval

Counts = Sequence[Sequence[int]]
Z = float(ndtri((1 + CONFIDENCE) / 2))


def james_index(counts: Counts) -> Interval | None:
    """Return James's index; None without guesses that chance could have made otherwise.

    Parameters
    ----------
    counts
        People, shape (groups, groups + 1): a row for each group that was allocated, a column for
        each group that was guessed, and the last one for “I do not know”.

    Notes
    -----
    All wrong guesses have one weight. The standard error follows from the multinomial counts by the
    delta method, its derivatives by complex steps.
    """
    people = np.array(counts, float)
    n = people.sum()
    if not n:
        return None
    shares = people / n
    if (estimate := _james(shares)) is None:
        return None
    step = 1e-30
    slopes = np.zeros(shares.shape)
    for place in np.argwhere(shares > 0):
        moved = shares.astype(complex)
        moved[tuple(place)] += step * 1j
        slopes[tuple(place)] = _james(moved).imag / step
    variance = ((shares * slopes**2).sum() - (shares * slopes).sum() ** 2) / n
    return _around(float(estimate), variance)


def _james(shares: Any) -> Any:
    """Return the index of a table of shares; None where it is not defined."""
    unknown = shares[:, -1].sum()
    guesses = shares[:, :-1]
    if not guesses.any():
        return 1.0
    guessed, allocated = guesses.sum(axis=0), guesses.sum(axis=1)
    wrong = guesses.sum() - np.trace(guesses)
    expected = guessed.sum() * allocated.sum() - (guessed * allocated).sum()
    if not expected:
        return None
    agreement = wrong * (1 - unknown) / expected - 1
    return (1 + unknown + (1 - unknown) * agreement) / 2


def bang_index(counts: Sequence[int], group: int) -> Interval | None:
    """Return Bang's index of one of two groups; None for no people.

    Parameters
    ----------
    counts
        The group's people: how many guessed the first group, the second, and do not know.
    group
        Which of the two it is, 0 or 1.
    """
    n = sum(counts)
    if not n:
        return None
    right, wrong = counts[group] / n, counts[1 - group] / n
    variance = (right * (1 - right) + wrong * (1 - wrong) + 2 * right * wrong) / n
    return _around(right - wrong, variance)


def _around(estimate: float, variance: float) -> Interval:
    margin = Z * float(np.sqrt(max(variance, 0.0)))
    return Interval(estimate, estimate - margin, estimate + margin)
