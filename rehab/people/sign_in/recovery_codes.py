"""Recovery codes: each signs its owner in once when the second factor is lost."""

from __future__ import annotations

import hashlib

from rehab.people.random_codes import ALPHABET, random_code

CODE_COUNT = 10
CODE_LENGTH = 12  # of 31 characters: 59 bits, out of reach even with the stored hashes


def generate_code() -> str:
    """Return a new recovery code in groups of four characters."""
    code = random_code(CODE_LENGTH)
    return "-".join(code[start : start + 4] for start in range(0, CODE_LENGTH, 4))


def hash_code(code: str) -> str:
    """Return the hash that is stored of a code; case, blanks and hyphens do not matter."""
    typed = "".join(character for character in code.upper() if character in ALPHABET)
    return hashlib.sha256(typed.encode()).hexdigest()
