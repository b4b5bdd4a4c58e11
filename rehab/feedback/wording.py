"""Which words a patient reads: the clinic's, or else the usual ones, in the patient's language."""

from __future__ import annotations

from collections.abc import Mapping

from django.utils.translation import gettext, override

FALLBACK = "en"  # the language that the rules' own words are in


def words_in(language: str, own: Mapping[str, str], usual: str) -> str:
    """Give words in a language.

    Where the clinic wrote none, the usual ones of that language; where nobody translated those
    either, the clinic's English ones or else the usual ones as they are.
    """
    if own.get(language):
        return own[language]
    translated = translate(usual, language)
    if translated != usual or language == FALLBACK:
        return translated
    return own.get(FALLBACK) or usual


def translate(words: str, language: str) -> str:
    """Give the rules' own words in a language."""
    with override(language):
        return gettext(words)
