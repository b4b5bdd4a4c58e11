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
    is_certain
        Whether nothing else is nearly as likely.
    doubt
        What speaks against it, else empty.
    """

    column: str
    side: str
    channel: str
    factor: float
    unit: str
    likeness: float
    is_certain: bool
    doubt: str = ""
