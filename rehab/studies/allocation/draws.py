"""Random draws that anyone can repeat from the seed, in any programming language."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from typing import TypeVar

T = TypeVar("T")
WORD_BITS = 64
# Stands in each registered document, for whoever allocates a study again; the examples are tested.
RULE = """\
Word n of a stream (n = 0, 1, 2, ...) is the first 8 bytes, big-endian, of the SHA-256 of these \
bytes in UTF-8: each part of the stream's name, written as its number of characters (Unicode code \
points, decimal), a colon and the part; then n in decimal; all with | between. \
"8:seedseed|6:blocks|0" gives 35c30df78c5b9bca, "8:seedseed|6:blocks|1" daafc5d83abeaf11, \
"8:seedseed|6:blocks|5:m\u00e4\u00dfig|0" bcb84f612d2283a3.
A number below k: the next word under floor(2^64 / k) * k, modulo k; words beyond are left out. \
A fraction: the next word without its last 11 bits, / 2^53. \
A shuffle: for i from the last place to the second, item i and item (number below i + 1) change \
places, counted from 0.
Blocks: the stream (seed, "blocks", the participant's level of each factor). Again and again: a \
size (sizes[number below their count]), then all groups in the registered order, each as often as \
its ratio gives in that size, shuffled.
Minimization: the stream (seed, "minimization", count of all earlier allocations). The groups are \
shuffled; the best is the first with the least imbalance (over the factors, the range of counts / \
ratio of those with the same level, the newcomer included). A fraction below the registered \
probability takes it, else others[number below their count] of the shuffled rest.
The seal is the SHA-256 of the secret as JSON with sorted keys, without blanks, in ASCII.
"""


class Draws:
    """A stream of draws by `RULE`.

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
