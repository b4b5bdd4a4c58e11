"""Minimization: each participant most likely joins the group that balances the factors best.

Pocock and Simon, Biometrics 31 (1975) 103-115, with the range as measure of imbalance and every
factor of the same weight. With unequal ratios, a group's counts are divided by its weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from rehab.studies.allocation.draws import Draws
from rehab.studies.allocation.groups_and_strata import Allocated, Group
from rehab.training.measures import InvalidSetting

# Of taking the best group: with 0.8 groups stay near balance, and the next one is hard to guess
# (simulations in Pocock and Simon favor 0.75 to 0.8).
DEFAULT_PROBABILITY = 0.8


def check_probability(groups: Sequence[Group], probability: float) -> None:
    """Raise InvalidSetting for a probability that does not balance, or leaves nothing to chance.

    Parameters
    ----------
    groups
        What is allocated.
    probability
        With which the best group is taken: above 1 / number of groups and below 1.
    """
    if not 1 / len(groups) < probability < 1:
        raise InvalidSetting(
            "The best group is taken with a probability above {least:.2f} and below 1, such as "
            "0.8: at 1 everybody could work out the next group.",
            least=1 / len(groups),
        )


def imbalance_after(
    groups: Sequence[Group], earlier: Sequence[Allocated], levels: Sequence[str], joined: Group
) -> Fraction:
    """Return the sum over factors of the range of counts, if a participant joined a group.

    Of each factor, those with the participant's level are counted in each group, and the count is
    divided by the group's weight (Pocock and Simon 1975).

    Parameters
    ----------
    groups, earlier
        What is allocated, and all allocations so far.
    levels
        The participant's level of each factor.
    joined
        The group to join.
    """
    total = Fraction(0)
    for position, level in enumerate(levels):
        alike = [past.group for past in earlier if past.levels[position] == level]
        counts = [
            Fraction(alike.count(group.name) + (group.name == joined.name), group.weight)
            for group in groups
        ]
        total += max(counts) - min(counts)
    return total


def choose_group(
    groups: Sequence[Group],
    earlier: Sequence[Allocated],
    levels: Sequence[str],
    probability: float,
    seed: str,
) -> str:
    """Return the group of the next participant.

    Of equally good groups one is drawn; it is taken with ``probability``, else one of the others,
    each equally likely.

    Parameters
    ----------
    groups, earlier
        What is allocated, and all allocations so far, in their order.
    levels
        The participant's level of each factor.
    probability
        With which the best group is taken, above 1 / number of groups and below 1.
    seed
        The study's secret.
    """
    draws = Draws(seed, "minimization", str(len(earlier)))
    order = draws.shuffle(groups)
    best = min(order, key=lambda group: imbalance_after(groups, earlier, levels, group))
    others = [group for group in order if group is not best]
    if draws.fraction() < probability:
        return best.name
    return others[draws.below(len(others))].name
