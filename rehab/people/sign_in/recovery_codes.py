"""Recovery codes: each lets its owner in once, when the second factor is lost."""

from __future__ import annotations

import hashlib
import secrets

RECOVERY_CODES = 10


RECOVERY_SIGNS = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"


RECOVERY_LENGTH = 12  # of 31 signs: 59 bits, out of reach even for whoever has the digests


def new_recovery_code() -> str:
    """Make a code that lets somebody in once, written in groups of four."""
    signs = [secrets.choice(RECOVERY_SIGNS) for _ in range(RECOVERY_LENGTH)]
    return "-".join("".join(signs[start : start + 4]) for start in range(0, RECOVERY_LENGTH, 4))


def digest_of(code: str) -> str:
    """Give what is kept of a recovery code; capitals, blanks and hyphens do not matter."""
    typed = "".join(sign for sign in code.upper() if sign in RECOVERY_SIGNS)
    return hashlib.sha256(typed.encode()).hexdigest()
