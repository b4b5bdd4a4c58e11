"""Words of feedback types: their names on pages, and what a patient reads in a language."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django.utils.translation import gettext, gettext_lazy, override

from rehab.training.valences import VALENCES

SOURCE_LANGUAGE = "en"  # of the words in `rehab.training.valences`


def valence_choices() -> list[tuple[str, Any]]:
    """Return the feedback types with their names.

    Models take the function itself as their choices: another type needs no migration.
    """
    return [(valence.slug, gettext_lazy(valence.label)) for valence in VALENCES.values()]


def pick_words(language: str, own: Mapping[str, str], default: str) -> str:
    """Return the words for patients who read a language.

    Parameters
    ----------
    own
        The clinic's words by language; a language may be missing or empty.
    default
        The default words, in English.

    Returns
    -------
    str
        The clinic's words, or else the default ones in that language; where these are not
        translated, the clinic's English words or else the default ones in English.
    """
    if own.get(language):
        return own[language]
    translated = translate(default, language)
    if translated != default or language == SOURCE_LANGUAGE:
        return translated
    return own.get(SOURCE_LANGUAGE) or default


def translate(words: str, language: str) -> str:
    """Return default words in a language; phrases that it has none for stay as they are."""
    with override(language):
        return "\n".join(map(gettext, words.splitlines()))
