"""Random codes that people read aloud and type: pairing and recovery codes, first passwords."""

from __future__ import annotations

import secrets

# Without 0 and O, 1, I and L, which are easily taken for each other.
ALPHABET = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"


def random_code(length: int) -> str:
    """Return a random code from the operating system's secure source."""
    return "".join(secrets.choice(ALPHABET) for _ in range(length))
