"""Keys of rows as forms and addresses name them."""

from __future__ import annotations

DIGITS_MAX = 18  # of a key that every database can hold; Python itself refuses some thousands


def read_key(text: str) -> int:
    """Return a row's key; 0, which no row has, for any other text."""
    return int(text) if text.isdecimal() and len(text) <= DIGITS_MAX else 0
