"""Random codes that people read aloud and type: pairing and recovery codes, first passwords."""

from __future__ import annotations

import secrets

# Without 0 and O, 1, I and L, which are easily taken for each other.
ALPHABET = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"


CONSONANTS, VOWELS = "bdfghjklmnprstvz", "aeiou"
# Words of these letters that insult or frighten in a language of the pages.
UNWELCOME = {
    *("bite", "bobo", "dago", "fude", "hate", "homo", "hure", "jode", "jodi", "jodo"),
    *("jude", "kaka", "kike", "lame", "loko", "lolo", "maso", "naga", "nazi", "nega"),
    *("nego", "nude", "nuke", "paki", "pedo", "pene", "pija", "pipi", "popo", "puta"),
    *("pute", "puti", "puto", "rape", "rata", "sado", "sida", "teta", "tete", "tote"),
    *("zizi",),
}


def random_words(count: int) -> str:
    """Return so many words that can be said and typed, without a meaning: "dafo-kimu-tero".

    Each has 12.6 bits; three are enough where attempts are limited (``sign_in.lockout``).
    """

    def word() -> str:
        drawn = "".join(secrets.choice(CONSONANTS) + secrets.choice(VOWELS) for _ in range(2))
        return word() if drawn in UNWELCOME else drawn

    return "-".join(word() for _ in range(count))


def random_code(length: int) -> str:
    """Return a random code from the operating system's secure source."""
    return "".join(secrets.choice(ALPHABET) for _ in range(length))
