"""What was found of an outcome: by intention to treat, per protocol, and if visits were missing."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from math import inf

from rehab.studies.analysis.clinical_outcomes import is_of_test
from rehab.studies.analysis.comparison import Difference, Interval, carry_over, compare
from rehab.studies.analysis.design_matrix import MIN_PARTICIPANTS, Observation
from rehab.studies.analysis.outcomes import BOUNDS
from rehab.studies.analysis.participants import Participant

# Who departed from the protocol, at which visit; None: as a whole.
Departure = tuple[str, int | None]


@dataclass(frozen=True, slots=True)
class ArmFigure:
    """An outcome in one arm: how many have and lack it, and the model's mean, cut at `BOUNDS`."""

    arm: str
    participants: int
    missing: int
    mean: Interval | None


@dataclass(frozen=True, slots=True)
class OutcomeResult:
    """An outcome over all arms, and the differences between them.

    Attributes
    ----------
    slug, arms
        The outcome's; its figures in each arm.
    differences
        By intention to treat: of all visits as they were allocated, with what missing could do.
    per_protocol
        Of the visits without a deviation from the protocol.
    carry_over
        Of a crossover, what arms add to the next period.
    """

    slug: str
    arms: tuple[ArmFigure, ...]
    differences: tuple[Difference, ...]
    per_protocol: tuple[Difference, ...] = ()
    carry_over: tuple[Difference, ...] = ()

    def without_few(self) -> OutcomeResult:
        """Return the same before the end: nothing of fewer people than an interval needs."""
        arms = tuple(
            one if one.participants >= MIN_PARTICIPANTS else replace(one, mean=None)
            for one in self.arms
        )
        enough = (one for one in self.differences if min(one.participants) >= MIN_PARTICIPANTS)
        return OutcomeResult(self.slug, arms, tuple(enough))

    def of_protocol(self, pair: Difference) -> Difference | None:
        """Return a pair's difference per protocol; None where there is none."""
        arms = pair.group, pair.reference
        return next((d for d in self.per_protocol if (d.group, d.reference) == arms), None)


def find(
    participants: Sequence[Participant],
    arms: Sequence[str],
    slug: str,
    *,
    crossover: bool,
    departures: Collection[Departure] = (),
) -> OutcomeResult:
    """Return what was found of an outcome.

    Parameters
    ----------
    participants, arms
        Everybody who was allocated; the codes of the arms, in the order of the differences.
    slug
        Of the outcome, or `CHANNEL` and a channel's name.
    crossover
        Whether everybody walks every arm, so that differences are within people.
    departures
        Who departed from the protocol, and at which visit.
    """
    observed = observations(participants, slug)
    compared = compare(observed, arms, crossover=crossover)
    figures = []
    for arm in arms:
        meant = sum(one.is_analyzed and arm in one.arms for one in participants)
        have_it = {one.participant for one in observed if one.arm == arm and one.value is not None}
        mean = compared.means.get(arm)
        mean = mean and mean.within(*BOUNDS.get(slug, (-inf, inf)))
        figures.append(ArmFigure(arm, len(have_it), meant - len(have_it), mean))
    followed = [one for one in observed if not has_departed(one, departures)]
    per_protocol = (
        compared if len(followed) == len(observed) else compare(followed, arms, crossover=crossover)
    )
    return OutcomeResult(
        slug,
        tuple(figures),
        compared.differences,
        per_protocol.differences,
        carry_over(observed, arms) if crossover else (),
    )


def has_departed(one: Observation, departures: Collection[Departure]) -> bool:
    """Return whether a visit departed from the protocol. ``departures``: as `find` takes them."""
    return not {(one.participant, one.visit), (one.participant, None)}.isdisjoint(departures)


def observations(participants: Sequence[Participant], slug: str) -> list[Observation]:
    """Return an outcome of all visits; without baselines where arms measure different things.

    Parameters
    ----------
    participants
        Everybody who was allocated.
    slug
        Of the outcome, or `CHANNEL` and a channel's name.
    """
    found = [one for participant in participants for one in participant.observe(slug)]
    if is_of_test(slug):
        return found
    if len({one.measure for one in participants if one.baseline is not None}) > 1:
        return [replace(one, baseline=None) for one in found]
    return found
