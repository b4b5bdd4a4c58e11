"""The valences as a clinic uses them: its own where it edited them, else the rules' defaults."""

from __future__ import annotations

from dataclasses import replace

from rehab.feedback.models import FeedbackType
from rehab.feedback.wording import FALLBACK, translate
from rehab.training.valences import VALENCES, Valence


def valences_of(clinic_id: int, language: str = FALLBACK) -> dict[str, Valence]:
    """Give all valences of a clinic, worded in a language. Raises InvalidSetting for a row that
    the rules refuse (the form lets none through).
    """
    rows = FeedbackType.everywhere.filter(clinic=clinic_id).prefetch_related("bands")
    own = {row.slug: row for row in rows}
    return {
        slug: own[slug].to_valence(language) if slug in own else usual_valence(slug, language)
        for slug in VALENCES
    }


def usual_valence(slug: str, language: str = FALLBACK) -> Valence:
    """Give a valence as the rules have it, worded in a language."""
    usual = VALENCES[slug]
    bands = (replace(band, words=translate(band.words, language)) for band in usual.bands)
    return replace(usual, bands=tuple(bands))
