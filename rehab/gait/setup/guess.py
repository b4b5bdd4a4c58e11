"""One column, and what it is thought to be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Guess:
    """What a column is thought to be.

    Attributes
    ----------
    column, side, channel
        Its name; and what it is.
    factor, unit
        What its numbers are multiplied with to SI units and our signs, and their unit.
    likeness
        Correlation with the channel's shape.
    is_named
        Whether its label says so, too.
    doubt
        What speaks against it, else empty.
    """

    column: str
    side: str
    channel: str
    factor: float
    unit: str
    likeness: float
    is_named: bool
    doubt: str = ""

    @property
    def is_certain(self) -> bool:
        """Whether its label, its unit and its curve agree."""
        return self.is_named and not self.doubt
