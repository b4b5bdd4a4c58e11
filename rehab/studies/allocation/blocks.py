"""Permuted blocks: each block holds every group in its ratio, in a random order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

from rehab.studies.allocation.draws import Draws
from rehab.studies.allocation.groups_and_strata import Group
from rehab.training.measures import InvalidSetting

MAX_BLOCK = 64


def check_block_sizes(groups: Sequence[Group], sizes: Sequence[int]) -> None:
    """Raise InvalidSetting for block sizes that the ratio does not fit.

    Parameters
    ----------
    groups
        What is allocated; their weights are the ratio.
    sizes
        Sizes of blocks: different multiples of the weights' sum, up to ``MAX_BLOCK``.
    """
    unit = sum(group.weight for group in groups)
    if not sizes or len(set(sizes)) != len(sizes):
        raise InvalidSetting("Give the sizes of blocks, each once, such as “4, 6”.")
    for size in sizes:
        if size <= 0 or size % unit or size > MAX_BLOCK:
            raise InvalidSetting(
                "A block of {size} does not fit the ratio {ratio}. Use multiples of {unit} up to "
                "{most}, such as {example}.",
                size=size,
                ratio=":".join(str(group.weight) for group in groups),
                unit=unit,
                most=MAX_BLOCK,
                example=f"{unit}, {2 * unit}",
            )


def block_of(groups: Sequence[Group], sizes: Sequence[int], draws: Draws) -> list[str]:
    """Return the next block: names of groups, each as often as its weight asks, in random order.

    Parameters
    ----------
    groups, sizes
        What is allocated, and the sizes of blocks, each drawn equally often.
    draws
        Where chance comes from; it goes on from block to block.
    """
    size = sizes[draws.below(len(sizes))]
    unit = sum(group.weight for group in groups)
    names = [group.name for group in groups for _ in range(group.weight * size // unit)]
    return draws.shuffle(names)


def sequence_of(
    groups: Sequence[Group], sizes: Sequence[int], seed: str, levels: Sequence[str]
) -> Iterator[str]:
    """Yield the names of a stratum's groups, block after block, without end.

    Parameters
    ----------
    groups, sizes
        What is allocated, and the sizes of blocks, each drawn equally often.
    seed, levels
        The study's secret, and the stratum's level of each factor.
    """
    draws = Draws(seed, "blocks", *levels)
    while True:
        yield from block_of(groups, sizes, draws)


def group_at(
    groups: Sequence[Group], sizes: Sequence[int], seed: str, levels: Sequence[str], index: int
) -> str:
    """Return the group of a stratum's participant.

    Parameters
    ----------
    groups, sizes
        What is allocated, and the sizes of blocks, each drawn equally often.
    seed, levels
        The study's secret, and the stratum's level of each factor.
    index
        Of the participant within the stratum, from 0.
    """
    return next(islice(sequence_of(groups, sizes, seed, levels), index, None))
