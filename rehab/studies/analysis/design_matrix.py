"""What an outcome is explained by: arms, visits, strata and the first baseline, as arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rehab.studies.analysis.mixed_model import Fit, Flags, Floats, fit

MIN_PARTICIPANTS = 3  # of an arm for which an interval, or a variance of its own, is given


@dataclass(frozen=True, slots=True)
class Observation:
    """An outcome of one visit.

    Attributes
    ----------
    participant, arm, visit
        Whose, in which arm, at which visit, counted from 1 over all periods.
    value
        The outcome; None at a visit that was due and gave none.
    baseline
        The participant's first baseline; None where that is unknown.
    period
        Of a crossover, from 0.
    strata
        The participant's level of each factor of the allocation.
    """

    participant: str
    arm: str
    visit: int
    value: float | None
    baseline: float | None = None
    period: int = 0
    strata: tuple[str, ...] = ()


@dataclass(frozen=True)
class Design:
    """Observations as arrays: n participants, t visits, k effects.

    Attributes
    ----------
    people, arms
        The participants, in the order of the rows; the arms that have a value.
    x, parts
        Shape (n, t, k) and (v, n, t, t), as `mixed_model.fit` takes them; also of missing visits.
    y, seen, due
        Shape (n, t): the values, whether there is one, and whether there should be.
    arm
        Shape (n, t): index of the arm in which a visit was due; -1 where none was.
    groups
        Shape (g, n): who was allocated alike.
    weights
        Shape (k,) for each arm whose mean can be told: of the effects that make the mean.
    """

    people: tuple[str, ...]
    arms: tuple[str, ...]
    x: Floats
    parts: Floats
    y: Floats
    seen: Flags
    due: Flags
    arm: NDArray[np.int64]
    groups: Flags
    weights: dict[str, Floats]

    @cached_property
    def fit(self) -> Fit:
        """The model of these observations."""
        return fit(self.x, self.y, self.seen, self.parts)


def parallel(observations: Sequence[Observation], arms: Sequence[str]) -> Design:
    """Return a design in which each arm has a mean of its own at each visit.

    Arms are compared over the visits that all of them walked, each with the same weight. Each arm
    has variances of its own, where all arms have enough people to tell them.

    Parameters
    ----------
    observations, arms
        All of an outcome; the codes of the arms that have a value of it.
    """
    table = _Table(observations, arms)
    cells = sorted({(one.arm, one.visit) for one in observations if one.value is not None})
    place = {cell: index for index, cell in enumerate(cells)}
    common = [v for v in table.visits if all((arm, v) in place for arm in arms)]
    x = np.zeros((*table.y.shape, len(cells)))
    in_arm = np.zeros((len(arms), len(table.people)), bool)
    for row, column, one in table.places:
        in_arm[arms.index(one.arm), row] = True
        if (one.arm, one.visit) in place:
            x[row, column, place[one.arm, one.visit]] = 1.0
    sizes = (in_arm & table.seen.any(axis=1)).sum(axis=1)
    groups = in_arm if sizes.min() >= MIN_PARTICIPANTS else np.ones((1, len(table.people)), bool)
    each, all_alike = np.eye(len(table.visits)), np.ones((len(table.visits),) * 2)
    parts = np.array(
        [group[:, None, None] * part for part in (each, all_alike) for group in groups]
    )
    weights = {arm: np.zeros(len(cells)) for arm in arms if common}
    for arm, of_arm in weights.items():
        of_arm[[place[arm, visit] for visit in common]] = 1 / len(common)
    covariates = np.column_stack([table.baselines, table.strata])
    x = np.concatenate([x, covariates[:, None, :] * np.asarray(x.any(axis=2))[..., None]], axis=2)
    zeros = np.zeros(covariates.shape[1])
    weights = {arm: np.concatenate([of_arm, zeros]) for arm, of_arm in weights.items()}
    return table.to_design(x, parts, weights, in_arm)


def crossover(
    observations: Sequence[Observation], arms: Sequence[str], *, carry_over: bool = False
) -> Design:
    """Return a design with an effect of each arm, and of each visit and with it the period.

    Visits of a person are alike, those of one period more so. All that is constant in a person
    cancels; of two arms, a difference has the variances of both, whatever they are.

    Parameters
    ----------
    observations, arms
        As for `parallel`.
    carry_over
        Whether the weights are those of what an arm adds to the next period, and not of the arm.
    """
    table = _Table(observations, arms)
    last = len(table.visits) - 1
    x = np.zeros((*table.y.shape, len(arms) + last))
    after = np.zeros((*table.y.shape, len(arms)))
    walked = {(one.participant, one.period): arms.index(one.arm) for *_, one in table.places}
    periods = np.zeros(last + 1)
    for row, column, one in table.places:
        x[row, column, arms.index(one.arm)] = 1.0
        if column == last:  # visits' effects sum to 0
            x[row, column, len(arms) :] = -1.0
        else:
            x[row, column, len(arms) + column] = 1.0
        periods[column] = one.period
        before = walked.get((one.participant, one.period - 1))
        if before is not None:
            after[row, column, before] = 1.0
    alike = (np.eye(last + 1), np.ones((last + 1,) * 2), periods[:, None] == periods[None, :])
    parts = np.array([np.broadcast_to(part, (len(table.people), *part.shape)) for part in alike])
    first = x.shape[2] if carry_over else 0
    x = np.concatenate([x, after], axis=2) if carry_over else x
    weights = {arm: np.eye(x.shape[2])[first + index] for index, arm in enumerate(arms)}
    return table.to_design(x, parts.astype(float), weights, np.ones((1, len(table.people)), bool))


class _Table:
    """Observations of arms that have a value: a row for each participant, a column for a visit."""

    def __init__(self, observations: Sequence[Observation], arms: Sequence[str]) -> None:
        observed = [one for one in observations if one.arm in arms]
        self.people = tuple(dict.fromkeys(one.participant for one in observed))
        self.visits = sorted({one.visit for one in observed if one.value is not None})
        self.arms = tuple(arms)
        rows = {person: row for row, person in enumerate(self.people)}
        columns = {visit: column for column, visit in enumerate(self.visits)}
        self.places = [
            (rows[one.participant], columns[one.visit], one)
            for one in observed
            if one.visit in columns
        ]
        shape = len(self.people), len(self.visits)
        self.y = np.zeros(shape)
        self.seen, self.arm = np.zeros(shape, bool), np.full(shape, -1)
        baselines = np.full(shape[0], np.nan)
        strata: dict[int, tuple[str, ...]] = {}
        for row, column, one in self.places:
            self.arm[row, column] = arms.index(one.arm)
            strata[row] = one.strata
            if one.value is not None:
                self.y[row, column], self.seen[row, column] = one.value, True
            if one.baseline is not None:
                baselines[row] = one.baseline
        walked = np.asarray(self.seen.any(axis=1))
        self.baselines = _standardize(baselines, walked)
        self.strata = _strata([strata.get(row, ()) for row in range(shape[0])], walked)

    def to_design(
        self, x: Floats, parts: Floats, weights: dict[str, Floats], groups: Flags
    ) -> Design:
        """Return the design. A visit at which nobody in the arm has a value was not due."""
        due = np.asarray(x.any(axis=2))
        return Design(
            *(self.people, self.arms, x, parts, self.y, self.seen, due),
            *(np.where(due, self.arm, -1), groups, weights),
        )


def _standardize(baselines: Floats, walked: Flags) -> Floats:
    """Return baselines about 0 with a spread of 1, unknown ones at 0; all 0 without a spread.

    The mean in place of a baseline that is missing keeps a randomized comparison unbiased (White
    and Thompson 2005, Statistics in Medicine 24:993-1007).
    """
    known = np.isfinite(baselines) & walked
    if known.sum() < 2 or not (spread := float(baselines[known].std())) > 0:
        return np.zeros_like(baselines)
    centered = (baselines - baselines[known].mean()) / spread
    return np.where(np.isfinite(baselines), centered, 0.0)


def _strata(levels: Sequence[tuple[str, ...]], walked: Flags) -> Floats:
    """Return an indicator of each factor's levels but the most frequent, about 0, shape (n, c).

    The means of arms are then those of everybody's strata; a factor that all share tells nothing.
    """
    columns = []
    for factor in range(max(map(len, levels), default=0)):
        of_factor = [one[factor] if factor < len(one) else "" for one in levels]
        counts = Counter(level for level, came in zip(of_factor, walked, strict=True) if came)
        for level, _count in sorted(counts.most_common(), key=lambda one: (-one[1], one[0]))[1:]:
            column = np.array([float(one == level) for one in of_factor])
            columns.append(column - column[walked].mean())
    return np.column_stack(columns) if columns else np.zeros((len(levels), 0))
