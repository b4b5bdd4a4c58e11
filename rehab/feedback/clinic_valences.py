"""The valences of a clinic: its own where it edited them, else the defaults."""

from __future__ import annotations

from dataclasses import replace

from rehab.feedback.models import FeedbackType
from rehab.feedback.translation import SOURCE_LANGUAGE, translate
from rehab.training.valences import VALENCES, Valence


def valences_of(clinic_id: int, language: str = SOURCE_LANGUAGE) -> dict[str, Valence]:
    """Return all valences of a clinic by slug, with words in a language.

    Raises InvalidSetting for a stored row that is not valid (the form admits none).
    """
    rows = FeedbackType.everywhere.filter(clinic=clinic_id).prefetch_related("bands")
    own = {row.slug: row for row in rows}
    return {
        slug: own[slug].to_valence(language) if slug in own else default_valence(slug, language)
        for slug in VALENCES
    }


def default_valence(slug: str, language: str = SOURCE_LANGUAGE) -> Valence:
    """Return a valence as it is by default, with words in a language."""
    default = VALENCES[slug]
    bands = (replace(band, words=translate(band.words, language)) for band in default.bands)
    return replace(default, bands=tuple(bands))
