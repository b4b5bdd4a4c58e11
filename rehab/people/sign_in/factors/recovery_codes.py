"""Recovery codes: each signs its owner in once when the second factor is lost."""

from __future__ import annotations

import hashlib
from datetime import datetime

from rehab.people.random_codes import ALPHABET, random_code

CODE_COUNT = 10
CODE_LENGTH = 20  # of 31 characters: 99 bits
# The cost of a hash: 16 MB and some 50 ms. Ten codes of an account share its salt, so that a typed
# one is hashed once and looked up.
SCRYPT_N, SCRYPT_R, SCRYPT_P = 2**14, 8, 1


def generate_code() -> str:
    """Return a new recovery code in groups of four characters."""
    code = random_code(CODE_LENGTH)
    return "-".join(code[start : start + 4] for start in range(0, CODE_LENGTH, 4))


def hash_code(code: str, account_id: int, joined_at: datetime) -> str:
    """Return the hash that is stored of an account's code; case, blanks and hyphens do not matter.

    The account and when it was made are the salt.
    """
    typed = "".join(character for character in code.upper() if character in ALPHABET)
    salt = f"{account_id} {joined_at.timestamp():.6f}".encode()
    return hashlib.scrypt(
        typed.encode(), salt=salt, n=SCRYPT_N, r=SCRYPT_R, p=SCRYPT_P, dklen=32
    ).hex()
