"""Valences (for people: feedback types): what a hit or a miss earns, with texts and gestures.

All of it is data. Pages and robots know no valence; they follow this data.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

from rehab.training.feedback_bands import (
    BANDS_MAX,
    BINARY_BANDS,
    EXPLICIT_BANDS,
    NEGATIVE_BANDS,
    POSITIVE_BANDS,
    TEXT_MAX,
    Band,
)
from rehab.training.measures import InvalidSetting
from robot.marking import Marked, gettext_noop
from robot.wire.cue_limits import VARIED

# Larger numbers mean nothing more to a patient, and overflow where points are stored.
POINTS_MAX = 1000
LONGEST = 8  # so many phrases of a type are tried when a page is laid out


class Emblem(StrEnum):
    """The drawing for what a step earned, recognizable by its shape alone."""

    GAIN = "gain"
    LOSS = "loss"
    NEUTRAL = "neutral"


@dataclass(frozen=True, slots=True)
class CueGestures:
    """Which gesture a robot performs after a window above or below its threshold; None for none.

    ``VARIED``, or the name of a pool, leaves the variant to the robot; any other name fixes it.
    """

    above: str | None = None
    below: str | None = None


@dataclass(frozen=True, slots=True)
class Valence:
    """A rule set of feedback.

    Attributes
    ----------
    slug, label, hue
        Its name in programs, its name for people (translated by pages), its pages' color.
    hit_points, miss_points
        Added to the score; None for both means that points do not exist.
    bands
        They rise from 0; where points exist one begins at 1, so that no text straddles the goal.
    cue
        The robot's gestures.

    Raises
    ------
    InvalidSetting
        For data that breaks these rules.
    """

    slug: str
    label: str
    hue: str
    hit_points: int | None
    miss_points: int | None
    bands: tuple[Band, ...]
    cue: CueGestures

    def __post_init__(self) -> None:
        label = Marked(self.label)
        if (self.hit_points is None) != (self.miss_points is None):
            raise InvalidSetting(
                "{type}: give points for hits and misses, or for neither.", type=label
            )
        if not 0 <= (self.hit_points or 0) <= POINTS_MAX:
            raise InvalidSetting(
                "{type}: a hit pays 0 to {most} points.", type=label, most=POINTS_MAX
            )
        if not -POINTS_MAX <= (self.miss_points or 0) <= 0:
            raise InvalidSetting(
                "{type}: a miss costs 0 to {most} points.", type=label, most=POINTS_MAX
            )
        starts = [band.from_performance for band in self.bands]
        rising = all(low < high for low, high in pairwise(starts))
        if not rising or starts[:1] != [0] or not all(map(math.isfinite, starts)):
            raise InvalidSetting(
                "{type}: the first band begins at 0, each next one higher.", type=label
            )
        if self.has_points and 1 not in starts:
            raise InvalidSetting("{type}: one band must begin at 1, the goal.", type=label)
        if len(self.bands) > BANDS_MAX:
            raise InvalidSetting("{type}: at most {most} bands.", type=label, most=BANDS_MAX)
        if any(len(phrase) > TEXT_MAX for band in self.bands for phrase in band.phrases):
            raise InvalidSetting(
                "{type}: words have at most {most} characters.", type=label, most=TEXT_MAX
            )

    @property
    def has_points(self) -> bool:
        """Whether points exist under this valence."""
        return self.hit_points is not None

    @property
    def rewards(self) -> bool:
        """Whether a hit earns points, so that pages show the patient a row of hits."""
        return (self.hit_points or 0) > 0

    def points(self, hit: bool, close: bool = False) -> int | None:
        """Return what a step adds to the score; None where points do not exist.

        Parameters
        ----------
        hit, close
            The step's verdict; a close step adds nothing.
        """
        if close:
            return 0 if self.has_points else None
        return self.hit_points if hit else self.miss_points

    def band(self, performance: float) -> Band:
        """Return the band that a performance falls in."""
        found = self.bands[0]
        for band in self.bands:
            if performance >= band.from_performance:
                found = band
        return found

    def longest_words(self) -> list[str]:
        """Return the phrases that need the most room: the longest, and that with the longest word.

        A page finds by them which layout has room for all; how lines break decides between several.
        """
        pool = [phrase for band in self.bands for phrase in band.phrases]
        wide = sorted(pool, key=lambda phrase: max(map(len, phrase.split()), default=0))[-1:]
        return list(dict.fromkeys(sorted(pool, key=len)[-LONGEST:] + wide))

    def emblem(self, hit: bool) -> Emblem:
        """Return the drawing for a hit or a miss: it follows the points, not the performance."""
        points = self.points(hit) or 0
        return Emblem.GAIN if points > 0 else Emblem.LOSS if points < 0 else Emblem.NEUTRAL

    def keeps_rule_set(self, hit_points: int | None, miss_points: int | None) -> bool:
        """Return whether it would still be the same rule set with other points.

        A study that names a type must be able to rely on it: a type that rewards hits always does,
        one that takes nothing for a miss never does, and one without points has none.

        Parameters
        ----------
        hit_points, miss_points
            Points for a hit and for a miss; None for both means no points.
        """
        if not self.has_points or hit_points is None or miss_points is None:
            return (hit_points, miss_points) == (self.hit_points, self.miss_points)
        return bool(hit_points) == bool(self.hit_points) and bool(miss_points) == bool(
            self.miss_points
        )


POSITIVE = Valence(
    slug="positive",
    label=gettext_noop("Positive"),
    hue="blue",
    hit_points=1,
    miss_points=0,
    bands=POSITIVE_BANDS,
    cue=CueGestures(above=VARIED),
)
NEGATIVE = Valence(
    slug="negative",
    label=gettext_noop("Negative"),
    hue="apricot",
    hit_points=0,
    miss_points=-1,
    bands=NEGATIVE_BANDS,
    cue=CueGestures(below=VARIED),
)
BINARY = Valence(
    slug="binary",
    label=gettext_noop("Binary"),
    hue="rose",
    hit_points=1,
    miss_points=-1,
    bands=BINARY_BANDS,
    cue=CueGestures(above=VARIED, below=VARIED),
)
EXPLICIT = Valence(
    slug="explicit",
    label=gettext_noop("Explicit"),
    hue="graphite",
    hit_points=None,
    miss_points=None,
    bands=EXPLICIT_BANDS,
    cue=CueGestures(),
)

VALENCES: dict[str, Valence] = {
    valence.slug: valence for valence in (POSITIVE, NEGATIVE, BINARY, EXPLICIT)
}


def find_valence(slug: str) -> Valence:
    """Return the valence of that slug. Raises InvalidSetting, naming the known ones."""
    try:
        return VALENCES[slug]
    except KeyError:
        raise InvalidSetting(
            "There is no valence {slug!r}. Known valences: {known}.",
            slug=slug,
            known=", ".join(VALENCES),
        ) from None


def edit_valence(
    slug: str,
    *,
    hit_points: int | None,
    miss_points: int | None,
    bands: Sequence[Band],
    cue: CueGestures,
) -> Valence:
    """Return a valence with points, bands and gestures that a clinic chose.

    Parameters
    ----------
    slug
        The valence that is edited.
    hit_points, miss_points
        Points for a hit and for a miss; None for both where it has no points.
    bands
        Words and confetti, rising from a performance of 0.
    cue
        The robot's gestures.

    Raises
    ------
    InvalidSetting
        For points that would make it another rule set, and for what ``Valence`` refuses.
    """
    usual = find_valence(slug)
    label = Marked(usual.label)
    if not usual.keeps_rule_set(hit_points, miss_points):
        if not usual.has_points:
            raise InvalidSetting(
                "{type} feedback has no points. Choose another type for other rules.", type=label
            )
        hit = Marked("pays for a hit") if usual.hit_points else Marked("pays nothing for a hit")
        miss = (
            Marked("takes for a miss") if usual.miss_points else Marked("takes nothing for a miss")
        )
        raise InvalidSetting(
            "{type} feedback {hit} and {miss}. Choose another type for other rules.",
            type=label,
            hit=hit,
            miss=miss,
        )
    if not usual.has_points and cue != CueGestures():
        raise InvalidSetting("{type} feedback only informs: its robot stands still.", type=label)
    return replace(
        usual, hit_points=hit_points, miss_points=miss_points, bands=tuple(bands), cue=cue
    )
