"""Bands of feedback: the words and confetti from a performance on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from rehab.training import phrases
from rehab.training.measures import InvalidSetting

BANDS_MAX = 12
TEXT_MAX = 60  # characters; longer texts do not fit a tablet at a size that is read from afar


class Confetti(StrEnum):
    """How much confetti a band releases."""

    NONE = "none"
    LITTLE = "little"
    MUCH = "much"
    MOST = "most"


@dataclass(frozen=True, slots=True)
class Band:
    """Words and confetti from this performance upwards, until the next band.

    Attributes
    ----------
    from_performance
        Where it begins (ratio to the goal).
    words
        For the patient: a pool of phrases, one a line, each of at most TEXT_MAX characters.
    confetti
        How much of it is released.
    """

    from_performance: float
    words: str
    confetti: Confetti = Confetti.NONE

    @property
    def phrases(self) -> tuple[str, ...]:
        """The phrases of its pool."""
        return tuple(filter(None, map(str.strip, self.words.splitlines())))


# The default bands of the feedback types. Their limits: docs/reference/scoring.md#bands (they split
# the recorded strides usefully; the original's did not).
_REWARDING = (
    Band(1, phrases.REACHED, Confetti.LITTLE),
    Band(1.1, phrases.STRONG, Confetti.MUCH),
    Band(1.25, phrases.STRONGEST, Confetti.MOST),
)
_MISSED = (Band(0, phrases.FAR_BELOW), Band(0.75, phrases.BELOW))
POSITIVE_BANDS = (Band(0, phrases.ONWARD), Band(0.75, phrases.NEAR), *_REWARDING)
NEGATIVE_BANDS = (*_MISSED, Band(1, phrases.NOTHING_LOST))
BINARY_BANDS = (*_MISSED, *_REWARDING)
EXPLICIT_BANDS = (Band(0, ""),)  # the page says the goal, and the value beside it


def bands_to_json(bands: Sequence[Band]) -> list[dict[str, Any]]:
    """Return bands as plain JSON data."""
    return [
        {"from_performance": b.from_performance, "words": b.words, "confetti": b.confetti.value}
        for b in bands
    ]


def bands_from_json(data: Any) -> tuple[Band, ...]:
    """Return the bands of ``bands_to_json``'s data. Raises InvalidSetting for anything else."""
    try:
        return tuple(_band_from_json(entry) for entry in data)
    except (KeyError, TypeError, ValueError):
        raise InvalidSetting(
            "A band has from_performance (a number), words (a text) and confetti ({known}).",
            known=", ".join(Confetti),
        ) from None


def _band_from_json(entry: Mapping[str, Any]) -> Band:
    start, words = entry["from_performance"], entry["words"]
    if not isinstance(words, str) or isinstance(start, bool) or not isinstance(start, int | float):
        raise TypeError
    return Band(start, words, Confetti(entry["confetti"]))
