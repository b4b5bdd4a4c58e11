"""How far missing visits would have to lie from what the model expects to change a conclusion.

The model expects of a missing visit what people with the same arm, covariates and other visits had
(missing at random). Here every missing value is moved against the difference by the same amount:
down in the arm that did better, up in the other. That is the limit of many imputations with a shift
(Carpenter and Kenward 2013, Multiple Imputation and its Application, chapter 10), without their
noise: with given variances, the estimate follows the imputed values in a straight line. Which
visits are missing is chance, too, and adds to the variance (White, Carpenter and Horton 2018,
Statistica Sinica 28:1985-2003).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rehab.studies.analysis.design_matrix import Design
from rehab.studies.analysis.mixed_model import Estimate, Floats


@dataclass(frozen=True, slots=True)
class Missing:
    """What missing visits could do to a difference.

    Attributes
    ----------
    visits
        How many are missing in the group and in the reference.
    slope
        How much smaller the difference becomes for each unit by which missing values lie lower in
        the group and higher in the reference.
    spread
        Variance that chance of missing adds, for a shift of one unit.
    estimate
        The difference, where missing visits are as the model expects.
    """

    visits: tuple[int, int]
    slope: float
    spread: float
    estimate: Estimate

    def shifted(self, delta: float) -> Estimate:
        """Return the difference where missing values lie ``delta`` against it, in its unit."""
        found = self.estimate
        error = (found.error**2 + delta**2 * self.spread) ** 0.5
        against = -delta * self.slope if found.value > 0 else delta * self.slope
        return Estimate(found.value + against, error, found.freedom)

    def tipping_point(self, confidence: float) -> float | None:
        """Return the least shift at which the interval reaches zero, in the outcome's unit.

        None where the interval has zero already, or no shift reaches it. ``confidence``: ratio.
        """
        found = self.estimate
        squared = found.quantile(confidence) ** 2
        c = found.value**2 - squared * found.error**2
        if c <= 0:
            return None
        a = self.slope**2 - squared * self.spread
        b = -2 * abs(found.value) * self.slope
        # Of a quadratic with a positive value at 0 the least positive zero, without cancellation.
        root = b * b - 4 * a * c
        if root < 0 or b >= 0:
            return None
        return float(2 * c / (-b + root**0.5))


def missing_of(design: Design, group: str, reference: str, estimate: Estimate) -> Missing | None:
    """Return what missing visits could do to the difference of two arms; None where none can.

    Parameters
    ----------
    design
        The observations, with the visits that are missing.
    group, reference, estimate
        The arms, and their difference.
    """
    missing = design.due & ~design.seen
    in_group, in_reference = (
        missing & (design.arm == design.arms.index(one)) for one in (group, reference)
    )
    if not (in_group | in_reference).any() or not design.fit.variances.any():
        return None
    weight = np.linalg.inv(_covariance(design))
    x = design.x * design.due[..., None]
    across = np.swapaxes(x, 1, 2) @ weight
    inverse = np.linalg.pinv((across @ x).sum(0), hermitian=True)
    signs = in_group.astype(float) - in_reference
    apart = design.weights[group] - design.weights[reference]
    of_people = np.einsum("k,nkt,nt->n", apart @ inverse, across, signs)
    spread = 0.0
    for rows in design.groups:
        count = int(rows.sum())
        if count > 1:
            spread += float(of_people[rows].var(ddof=1)) * count
    visits = int(in_group.sum()), int(in_reference.sum())
    return Missing(visits, float(of_people.sum()), spread, estimate)


def _covariance(design: Design) -> Floats:
    """Return each person's covariance of all visits that were due, shape (n, t, t)."""
    due = design.due
    both = due[:, :, None] & due[:, None, :]
    known = np.einsum("v,vnst->nst", design.fit.variances, design.parts * both)
    return np.asarray(known + np.eye(due.shape[1]) * ~due[:, :, None])
