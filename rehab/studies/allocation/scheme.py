"""How a study allocates: what everyone may read, and what is sealed until its end."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from hashlib import sha256
from typing import Any

from rehab.studies.allocation import blocks, lists, minimization
from rehab.studies.allocation.groups_and_strata import (
    Allocated,
    Factor,
    Group,
    check_factors,
    check_groups,
    check_levels,
)
from rehab.studies.allocation.lists import ListEntry
from rehab.training.measures import InvalidSetting

MIN_SEED_LETTERS = 8


class Method(StrEnum):
    """How participants are allocated."""

    BLOCKS = "blocks"
    MINIMIZATION = "minimization"
    LIST = "list"


@dataclass(frozen=True, slots=True)
class Secret:
    """What would reveal the next allocation: sealed until the study ends.

    Attributes
    ----------
    seed
        Of all draws; of a list, what keeps its commitment from being guessed.
    block_sizes
        Of permuted blocks, each drawn equally often.
    listed
        The entries of the study's own list.
    """

    seed: str
    block_sizes: tuple[int, ...] = ()
    listed: tuple[ListEntry, ...] = ()

    def to_text(self) -> str:
        """Return the secret as canonical JSON."""
        return json.dumps(asdict(self), sort_keys=True, separators=(",", ":"))

    @classmethod
    def from_text(cls, text: str) -> Secret:
        """Return the secret of ``to_text``."""
        data = json.loads(text)
        entries = (ListEntry(**row | {"levels": tuple(row["levels"])}) for row in data["listed"])
        return cls(data["seed"], tuple(data["block_sizes"]), tuple(entries))

    @property
    def commitment(self) -> str:
        """The SHA-256 of the secret, which can be published: it shows later that nothing changed.

        Seeds are drawn with 128 bits or more, too many to try them all.
        """
        return sha256(self.to_text().encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Scheme:
    """How a study allocates, as far as everybody may know it.

    Attributes
    ----------
    groups, factors
        What is allocated, and over what it is balanced: strata of blocks and lists, factors of
        minimization.
    method
        How.
    probability
        Of minimization: with which the best group is taken.

    Raises
    ------
    InvalidSetting
        For a scheme that could not allocate.
    """

    groups: tuple[Group, ...]
    method: Method
    factors: tuple[Factor, ...] = ()
    probability: float = minimization.DEFAULT_PROBABILITY

    def __post_init__(self) -> None:
        check_groups(self.groups)
        check_factors(self.factors)
        if self.method is Method.MINIMIZATION:
            if not self.factors:
                raise InvalidSetting(
                    "Minimization balances factors: name at least one, or choose blocks."
                )
            minimization.check_probability(self.groups, self.probability)

    def check_secret(self, secret: Secret) -> None:
        """Raise InvalidSetting for a secret that does not fit the scheme."""
        if len(secret.seed) < MIN_SEED_LETTERS:
            raise InvalidSetting(
                "A seed has at least {least} letters or digits.", least=MIN_SEED_LETTERS
            )
        if self.method is Method.BLOCKS:
            blocks.check_block_sizes(self.groups, secret.block_sizes)
        if self.method is Method.LIST and not secret.listed:
            raise InvalidSetting("Paste the list with which participants are allocated.")

    def allocate(self, secret: Secret, earlier: Sequence[Allocated], levels: Sequence[str]) -> str:
        """Return the group of the next participant.

        Parameters
        ----------
        secret
            The study's seed or list.
        earlier
            All allocations of the study, in their order.
        levels
            The participant's level of each factor.

        Raises
        ------
        InvalidSetting
            For an unknown level, and where a list has ended.
        """
        here = check_levels(self.factors, levels)
        before = sum(past.levels == here for past in earlier)
        match self.method:
            case Method.BLOCKS:
                sizes = secret.block_sizes
                return blocks.group_at(self.groups, sizes, secret.seed, here, before)
            case Method.MINIMIZATION:
                return minimization.choose_group(
                    self.groups, earlier, here, self.probability, secret.seed
                )
            case Method.LIST:
                return lists.group_at(secret.listed, here, before)

    def to_json(self) -> dict[str, Any]:
        """Return the scheme as plain JSON data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Scheme:
        """Return the scheme of ``to_json``."""
        return cls(
            groups=tuple(Group(tuple(row["arms"]), row["weight"]) for row in data["groups"]),
            method=Method(data["method"]),
            factors=tuple(Factor(row["name"], tuple(row["levels"])) for row in data["factors"]),
            probability=data["probability"],
        )
