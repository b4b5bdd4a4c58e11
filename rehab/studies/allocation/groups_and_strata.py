"""Groups that participants are allocated to, and the factors that strata are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rehab.training.measures import InvalidSetting

MAX_WEIGHT = 9
MAX_STRATA = 64


@dataclass(frozen=True, slots=True)
class Group:
    """What a participant is allocated to.

    Attributes
    ----------
    arms
        The codes of its arms: one, or in a crossover all of them in the order of the periods.
    weight
        Its part of the ratio: of groups with weights 2 and 1, the first gets two of three.
    """

    arms: tuple[str, ...]
    weight: int = 1

    @property
    def name(self) -> str:
        """The name of the group: its arms, in their order."""
        return "-".join(self.arms)


@dataclass(frozen=True, slots=True)
class Factor:
    """A property of participants over which groups are balanced, with its levels."""

    name: str
    levels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Allocated:
    """One allocation that has been made: the levels of the factors, in their order; the group."""

    levels: tuple[str, ...]
    group: str


def check_groups(groups: Sequence[Group]) -> None:
    """Raise InvalidSetting for groups among which nothing could be allocated."""
    if len({group.name for group in groups}) != len(groups):
        raise InvalidSetting("Two groups are the same. Give each arm its own code.")
    if len(groups) < 2:
        raise InvalidSetting("A study compares at least two arms. Add another one.")
    if any(not 1 <= group.weight <= MAX_WEIGHT for group in groups):
        raise InvalidSetting(
            "Ratios are whole numbers of 1 to {most}, such as 2 and 1.", most=MAX_WEIGHT
        )


def check_factors(factors: Sequence[Factor]) -> None:
    """Raise InvalidSetting for factors that do not distinguish participants."""
    if len({factor.name for factor in factors}) != len(factors):
        raise InvalidSetting("Two factors have the same name. Give each its own.")
    strata = 1
    for factor in factors:
        if len(factor.levels) < 2 or len(set(factor.levels)) != len(factor.levels):
            raise InvalidSetting(
                "The factor {name} needs at least two different levels, such as “mild, severe”.",
                name=factor.name,
            )
        strata *= len(factor.levels)
    if strata > MAX_STRATA:
        raise InvalidSetting(
            "These factors make {strata} strata, and most would stay empty. Leave some out: at "
            "most {most} can be kept.",
            strata=strata,
            most=MAX_STRATA,
        )


def check_levels(factors: Sequence[Factor], levels: Sequence[str]) -> tuple[str, ...]:
    """Return the levels of one participant.

    Parameters
    ----------
    factors
        The study's factors.
    levels
        The participant's level of each, in the same order.

    Raises
    ------
    InvalidSetting
        For an unknown level, and for too many or too few.
    """
    for factor, level in zip(factors, levels, strict=False):
        if level not in factor.levels:
            raise InvalidSetting(
                "{name} has no level “{level}”. Choose one of: {known}.",
                name=factor.name,
                level=level,
                known=", ".join(factor.levels),
            )
    if len(levels) != len(factors):
        raise InvalidSetting(
            "Give one level of each factor: {names}.",
            names=", ".join(factor.name for factor in factors),
        )
    return tuple(levels)


def find_group(groups: Iterable[Group], name: str) -> Group:
    """Return the one of ``groups`` with that name. Raises InvalidSetting, naming the known ones."""
    known = {group.name: group for group in groups}
    try:
        return known[name]
    except KeyError:
        raise InvalidSetting(
            "The study has no group “{name}”. Its groups are: {known}.",
            name=name,
            known=", ".join(known),
        ) from None
