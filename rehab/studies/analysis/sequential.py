"""Looks before the end that keep the chance of a false finding, and what spread says of the size.

Each look may spend a part of alpha, by how much of the information there is (Lan and DeMets 1983,
Biometrika 70:659-663). Bounds are two-sided; those of later looks follow by integration over where
a study can be that was not stopped (Armitage, McPherson and Rowe 1969, JRSS A 132:235-244).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import ndtr, ndtri

from rehab.studies.analysis.mixed_model import Floats

ALPHA = 0.05
GRID = 501  # points of an integral; bounds are then right to 1e-4
ROUNDS = 60  # of a bisection
BEYOND = 8.0  # standard errors at which a study never is


def obrien_fleming(share: float) -> float:
    """Return alpha spent by a share of the information, like O'Brien and Fleming's: seldom early.

    2 - 2 Phi(z(1 - alpha / 4) / sqrt(share)) on each side, Lan and DeMets 1983.
    """
    return float(4 * ndtr(ndtri(ALPHA / 4) / math.sqrt(share)))


def pocock(share: float) -> float:
    """Return alpha spent by a share of the information, like Pocock's: about alike at each look.

    alpha ln(1 + (e - 1) share), Lan and DeMets 1983.
    """
    return ALPHA * math.log(1 + (math.e - 1) * share)


SPENDING: dict[str, Callable[[float], float]] = {
    "obrien_fleming": obrien_fleming,
    "pocock": pocock,
}


def levels(spending: str, looks: Sequence[int], planned: int, *, is_last: bool) -> list[float]:
    """Return below which p each look finds a difference.

    Parameters
    ----------
    spending
        Of `SPENDING`.
    looks
        How many participants had the outcome at each look, growing.
    planned
        How many are to have it at the end.
    is_last
        Whether the last look is the end, which spends what is left, whatever was planned.
    """
    shares = [min(look / planned, 1.0) for look in looks]
    if is_last:
        shares[-1] = 1.0
    spent = np.array([SPENDING[spending](share) for share in shares])
    each = np.diff(spent, prepend=0.0)
    return [float(2 * ndtr(-bound)) for bound in bounds(looks, each)]


def bounds(information: Sequence[float], spent: Sequence[float] | Floats) -> list[float]:
    """Return the two-sided bound of z at each look; `BEYOND` where nothing is spent.

    Parameters
    ----------
    information, spent
        Of each look: how much there is, growing, in any unit; alpha that it spends by itself.
    """
    found: list[float] = []
    at = np.zeros(1)
    density = np.ones(1)  # of the sum z sqrt(information) of studies that go on
    before = 0.0
    for amount, alpha in zip(information, spent, strict=True):
        step = math.sqrt(amount - before) if amount > before else 0.0
        root = math.sqrt(amount)
        low, high = 0.0, BEYOND
        for _ in range(ROUNDS):
            middle = (low + high) / 2
            is_low = _crossed(at, density, step, middle * root) > alpha
            low, high = (middle, high) if is_low else (low, middle)
        found.append(high)
        if step > 0:
            grid = np.linspace(-high * root, high * root, GRID)
            weight = np.full(GRID, grid[1] - grid[0])
            weight[[0, -1]] /= 2
            kernel = np.exp(-(((grid[:, None] - at) / step) ** 2) / 2) / math.sqrt(2 * math.pi)
            at, density = grid, weight * (kernel @ density) / step
        before = max(before, amount)
    return found


def _crossed(at: Floats, density: Floats, step: float, edge: float) -> float:
    """Return the chance of being beyond an edge after a step from where a study can be."""
    if step == 0:
        return float(density[np.abs(at) > edge].sum())
    return float(density @ (ndtr((at - edge) / step) + ndtr((-at - edge) / step)))


def blinded_size(values: Sequence[float], planned_sd: float, planned: int) -> tuple[float, int]:
    """Return the spread of all participants together, and how many they then have to be.

    Whoever knows it knows nothing of arms. The size grows with the variance, and never shrinks
    (Kieser and Friede 2003, Statistics in Medicine 22:3571-3581).

    Parameters
    ----------
    values
        The primary outcome of each participant, whatever the arm; at least two.
    planned_sd, planned
        The standard deviation that the size rests on, in the outcome's unit; the size.
    """
    sd = float(np.std(np.asarray(values, dtype=float), ddof=1))
    return sd, max(planned, math.ceil(planned * (sd / planned_sd) ** 2))
