"""A linear mixed model for a few visits of each person, by restricted maximum likelihood (REML).

Estimates are unbiased where visits are missing at random: depending on the arm, the baseline and
what was seen before (Rubin 1976, Biometrika 63:581-592). Intervals are those of Kenward and Roger
(1997, Biometrics 53:983-997), for small groups, by the observed information: the expected one holds
only where visits are missing completely at random (Kenward and Molenberghs 1998, Statistical
Science 13:236-247; Thomadakis et al. 2023, Statistics in Medicine 42:2873-2885).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
MAX_ROUNDS = 200
TOLERANCE = 1e-9  # relative change of the variances at which the iteration ends
LEAST_EIGENVALUE = 1e-7  # of a person's covariance, as a share of the residual variance
SINGULAR = 1e-3  # an information whose least eigenvalue is below this share of the largest
EXACT = 1e-12  # a residual variance below this share of the values' is rounding alone


@dataclass(frozen=True, slots=True)
class Estimate:
    """A linear combination of effects, its standard error and degrees of freedom."""

    value: float
    error: float
    freedom: float

    def interval(self, confidence: float) -> tuple[float, float]:
        """Return both ends of Student's interval."""
        half = self.quantile(confidence) * self.error
        return self.value - half, self.value + half

    def quantile(self, confidence: float) -> float:
        """Return Student's quantile of a two-sided interval. ``confidence``: ratio."""
        return float(stdtrit(self.freedom, (1 + confidence) / 2))

    @property
    def p(self) -> float:
        """Student's two-sided p of no effect; 0 or 1 where nothing scatters."""
        if self.error == 0:
            return float(self.value == 0)
        return float(2 * stdtr(self.freedom, -abs(self.value) / self.error))


@dataclass(frozen=True)
class Fit:
    """A model that was fitted.

    Attributes
    ----------
    effects
        Shape (k,), in the unit of the values.
    span
        Shape (k, k): projects on the combinations of effects that the data tell.
    plain, adjusted
        Shape (k, k): covariance of the effects, without and with the small-sample correction.
    slopes
        Shape (v, k, k): how ``plain`` changes with each variance.
    of_variances
        Shape (v, v): covariance of the estimated variances.
    freedom
        Observations less effects; without any there are no intervals.
    variances
        Shape (v,): of each part of the covariance, 0 where the data do not tell it.
    """

    effects: Floats
    span: Floats
    plain: Floats
    adjusted: Floats
    slopes: Floats
    of_variances: Floats
    freedom: int
    variances: Floats

    def tells(self, weights: Floats) -> bool:
        """Return whether the data tell a combination of effects. ``weights``: shape (k,)."""
        return bool(np.allclose(self.span @ weights, weights, atol=1e-8))

    def estimate(self, weights: Floats) -> Estimate:
        """Return a combination of effects. ``weights``: shape (k,)."""
        value, plain = float(weights @ self.effects), float(weights @ self.plain @ weights)
        if plain <= 0 or self.freedom < 1:
            return Estimate(value, 0.0, float(self.freedom))
        slopes = np.einsum("k,vkl,l->v", weights, self.slopes, weights) / plain
        spread = float(slopes @ self.of_variances @ slopes)
        freedom = min(2 / spread, float(self.freedom)) if spread > 0 else float(self.freedom)
        error = float(weights @ self.adjusted @ weights)
        return Estimate(value, max(error, plain) ** 0.5, freedom)


def fit(x: Floats, y: Floats, seen: Flags, parts: Floats) -> Fit:
    """Return the model that explains values by effects, with visits of a person that are alike.

    Parameters
    ----------
    x
        Shape (n, t, k): for each person and visit what each effect is multiplied with.
    y, seen
        Shape (n, t): the values, and whether there is one.
    parts
        Shape (v, n, t, t): what each variance adds to each person's covariance. Parts on the
        diagonal are the variances that each visit has of its own, and add up to 1 there; in the
        others 1 stands where two visits of a person share a variance.
    """
    x, y = np.where(seen[..., None], x, 0.0), np.where(seen, y, 0.0)
    every, parts = parts, parts * (seen[:, :, None] & seen[:, None, :])
    off_diagonal = 1 - np.eye(seen.shape[1])
    own = ~np.asarray((parts * off_diagonal).any(axis=(1, 2, 3)))
    # A part that no two visits of anybody share could not be told from the visits' own.
    of_visits = ~np.asarray((every * off_diagonal).any(axis=(1, 2, 3)))
    used = np.asarray(parts.any(axis=(1, 2, 3))) & (~own | of_visits)
    # Nor could one that adds the same as another: of one visit in each period, say.
    used &= [not any(map(partial(np.array_equal, one), parts[:n])) for n, one in enumerate(parts)]
    parts = parts[used]
    count, rank = int(seen.sum()), int(np.linalg.matrix_rank(x.reshape(-1, x.shape[2])))
    effects, span, residual = _least_squares(x, y)
    freedom = count - rank
    residual_variance = residual / freedom if freedom > 0 else 0.0
    if residual_variance <= EXACT * max(float((y * y).sum()) / max(count, 1), 1e-300):
        zero = np.zeros_like(span)
        none = np.zeros((len(parts), *span.shape))
        of_variances = np.zeros((len(parts),) * 2)
        nothing = np.zeros(len(every))
        return Fit(effects, span, zero, zero, none, of_variances, freedom, nothing)
    variances = np.where(own[used], residual_variance, 0.0)
    for _ in range(MAX_ROUNDS):
        _round = _Round(x, y, seen, parts, variances)
        target = np.linalg.pinv(_round.information) @ (_round.squares / 2)
        step = _largest_step(parts, seen, variances, target, residual_variance)
        moved = variances + step * (target - variances)
        change = float(np.abs(moved - variances).max()) / residual_variance
        variances = moved
        if change < TOLERANCE:
            break
    estimated = np.zeros(len(every))
    estimated[used] = variances
    return _Round(x, y, seen, parts, variances).to_fit(span, freedom, estimated)


def _least_squares(x: Floats, y: Floats) -> tuple[Floats, Floats, float]:
    flat = x.reshape(-1, x.shape[2])
    inverse = np.linalg.pinv(flat)
    effects = inverse @ y.ravel()
    residual = y.ravel() - flat @ effects
    return effects, inverse @ flat, float(residual @ residual)


def _largest_step(
    parts: Floats, seen: Flags, here: Floats, target: Floats, residual_variance: float
) -> float:
    """Return how far to go towards a target such that covariances stay positive."""
    step = 1.0
    for _ in range(40):
        values = _covariance(parts, seen, here + step * (target - here), residual_variance)
        if np.linalg.eigvalsh(values).min() >= LEAST_EIGENVALUE * residual_variance:
            return step
        step /= 2
    return 0.0


def _covariance(parts: Floats, seen: Flags, variances: Floats, unseen: float) -> Floats:
    """Return each person's covariance, shape (n, t, t); ``unseen`` stands for missing visits."""
    missing = unseen * np.eye(seen.shape[1]) * ~seen[:, :, None]
    return np.asarray(np.einsum("v,vnst->nst", variances, parts) + missing)


class _Round:
    """What follows from given variances: effects, and the next variances."""

    def __init__(self, x: Floats, y: Floats, seen: Flags, parts: Floats, variances: Floats) -> None:
        weight = np.linalg.inv(_covariance(parts, seen, variances, 1.0))
        across = np.swapaxes(x, 1, 2)
        self.plain = np.linalg.pinv((across @ weight @ x).sum(0), hermitian=True)
        self.effects = self.plain @ np.einsum("ntk,nt->k", weight @ x, y)
        error = np.einsum("nst,nt->ns", weight, y - x @ self.effects)
        pulled = np.einsum("vnst,nt->vns", parts, error)
        self.squares = np.einsum("ns,vns->v", error, pulled)
        weighted = weight @ parts  # (v, n, t, t)
        self.slopes = (across @ weighted @ weight @ x).sum(1)  # (v, k, k)
        traces = np.einsum("vnst,wnts->vw", weighted, weighted, optimize=True)
        spread = weight @ x @ self.plain @ across
        once = np.einsum("vnst,wnts->vw", weighted, weighted @ spread, optimize=True)
        mixed = self.plain @ self.slopes
        twice = np.einsum("vkl,wlk->vw", mixed, mixed)
        self.information = (traces - 2 * once + twice) / 2
        inner = np.einsum("nst,vnt->vns", weight, pulled)
        crossed = np.einsum("nsk,vns->vk", x, inner)
        self.moves = crossed @ self.plain  # (v, k): how effects change with each variance
        squares = np.einsum("vns,wns->vw", pulled, inner) - self.moves @ crossed.T
        self.observed = squares - self.information
        ends = np.linalg.eigvalsh(self.observed)[[0, -1]]
        if ends[0] < SINGULAR * ends[1]:  # the mean of both kinds of information never is negative
            self.observed = squares / 2

    def to_fit(self, span: Floats, freedom: int, variances: Floats) -> Fit:
        """Return the fit with the correction of Kenward and Roger; the rest as `Fit` has it."""
        of_variances = np.linalg.pinv(self.observed, hermitian=True)
        adjusted = self.plain + 2 * self.moves.T @ of_variances @ self.moves
        slopes = self.plain @ self.slopes @ self.plain
        return Fit(
            *(self.effects, span, self.plain, adjusted, slopes, of_variances, freedom, variances)
        )
