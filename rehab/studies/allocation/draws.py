"""Random draws that anyone can repeat from the seed, in any programming language."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from typing import TypeVar

T = TypeVar("T")
WORD_BITS = 64


class Draws:
    """A stream of draws: the first 8 bytes of SHA-256 of "seed|context|counter", big-endian.

    Parameters
    ----------
    seed
        The study's secret.
    context
        What the draws are for, such as a stratum: streams of other contexts are independent.
    """

    def __init__(self, seed: str, *context: str) -> None:
        # Lengths distinguish ("ab", "c") from ("a", "bc").
        self._prefix = "|".join(f"{len(part)}:{part}" for part in (seed, *context))
        self._counter = 0

    def below(self, limit: int) -> int:
        """Return a whole number of [0, limit), each equally likely."""
        fair = (1 << WORD_BITS) // limit * limit  # words beyond it would favor small numbers
        while True:
            word = self._word()
            if word < fair:
                return word % limit

    def fraction(self) -> float:
        """Return a number of [0, 1), of 53 random bits."""
        return (self._word() >> (WORD_BITS - 53)) / (1 << 53)

    def shuffle(self, items: Sequence[T]) -> list[T]:
        """Return the items in a random order (Fisher and Yates, from the end)."""
        order = list(items)
        for last in range(len(order) - 1, 0, -1):
            other = self.below(last + 1)
            order[last], order[other] = order[other], order[last]
        return order

    def _word(self) -> int:
        digest = sha256(f"{self._prefix}|{self._counter}".encode()).digest()
        self._counter += 1
        return int.from_bytes(digest[: WORD_BITS // 8], "big")
