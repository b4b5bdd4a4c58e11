"""Feedback valences: what a hit or a miss earns, and what is said and shown about it.

All of it is data. Pages and robots know no valence: they draw and do what these rows say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from rehab.training.measures import InvalidSetting

# More would say no more, and overflow where points are stored.
POINTS_MAX = 1000


class Emblem(StrEnum):
    """The drawing that says what a step meant, told apart by shape alone."""

    GAIN = "gain"
    LOSS = "loss"
    NEUTRAL = "neutral"


class Confetti(StrEnum):
    """How much confetti a band sets free."""

    NONE = "none"
    LITTLE = "little"
    MUCH = "much"
    MOST = "most"


@dataclass(frozen=True, slots=True)
class Band:
    """What is said from this performance upwards, until the next band."""

    from_performance: float
    words: str
    confetti: Confetti = Confetti.NONE


@dataclass(frozen=True, slots=True)
class Cue:
    """Which gesture a robot performs after a window above or below its threshold; None for none."""

    above: str | None = None
    below: str | None = None


@dataclass(frozen=True, slots=True)
class Valence:
    """A rule set of feedback.

    ``hit_points`` and ``miss_points`` are added to the score; None for both means that points do
    not exist. ``bands`` rise from 0; where points exist one begins at 1, so that no words straddle
    the goal. Raises InvalidSetting for data that breaks these rules.
    """

    slug: str
    label: str
    hue: str
    hit_points: int | None
    miss_points: int | None
    bands: tuple[Band, ...]
    cue: Cue

    def __post_init__(self) -> None:
        if (self.hit_points is None) != (self.miss_points is None):
            raise InvalidSetting(f"{self.label}: give points for hits and misses, or for neither.")
        if not 0 <= (self.hit_points or 0) <= POINTS_MAX:
            raise InvalidSetting(f"{self.label}: a hit pays 0 to {POINTS_MAX} points.")
        if not -POINTS_MAX <= (self.miss_points or 0) <= 0:
            raise InvalidSetting(f"{self.label}: a miss costs 0 to {POINTS_MAX} points.")
        starts = [band.from_performance for band in self.bands]
        rising = all(low < high for low, high in pairwise(starts))
        if not rising or starts[:1] != [0] or not all(map(math.isfinite, starts)):
            raise InvalidSetting(f"{self.label}: the first band begins at 0, each next one higher.")
        if self.has_points and 1 not in starts:
            raise InvalidSetting(f"{self.label}: one band must begin at 1, the goal.")

    @property
    def has_points(self) -> bool:
        """Whether points exist under this valence."""
        return self.hit_points is not None

    @property
    def rewards(self) -> bool:
        """Whether a hit earns anything, so that a row of hits is worth telling the patient."""
        return (self.hit_points or 0) > 0

    def points(self, hit: bool) -> int | None:
        """Give what a hit or a miss adds to the score."""
        return self.hit_points if hit else self.miss_points

    def band(self, performance: float) -> Band:
        """Give the band that a performance falls in."""
        found = self.bands[0]
        for band in self.bands:
            if performance >= band.from_performance:
                found = band
        return found

    def emblem(self, hit: bool) -> Emblem:
        """Give the drawing for a hit or a miss: it follows the points, not the performance."""
        points = self.points(hit) or 0
        return Emblem.GAIN if points > 0 else Emblem.LOSS if points < 0 else Emblem.NEUTRAL


# Band limits: product.md 4.1 (they split the recorded strides usefully; the original's did not).
POSITIVE = Valence(
    slug="positive",
    label="Positive",
    hue="blue",
    hit_points=1,
    miss_points=0,
    bands=(
        Band(0, "On to the next step."),
        Band(0.75, "Nearly there. Keep walking."),
        Band(1, "You reached the goal!", Confetti.LITTLE),
        Band(1.1, "Strong push!", Confetti.MUCH),
        Band(1.25, "What a push!", Confetti.MOST),
    ),
    cue=Cue(above="celebrate"),
)
NEGATIVE = Valence(
    slug="negative",
    label="Negative",
    hue="apricot",
    hit_points=0,
    miss_points=-1,
    bands=(
        Band(0, "Far below the goal."),
        Band(0.75, "Below the goal."),
        Band(1, "No points lost."),
    ),
    cue=Cue(below="droop"),
)
BINARY = Valence(
    slug="binary",
    label="Binary",
    hue="rose",
    hit_points=1,
    miss_points=-1,
    bands=(
        Band(0, "Far below the goal."),
        Band(0.75, "Below the goal."),
        Band(1, "You reached the goal!", Confetti.LITTLE),
        Band(1.1, "Strong push!", Confetti.MUCH),
        Band(1.25, "What a push!", Confetti.MOST),
    ),
    cue=Cue(above="celebrate", below="droop"),
)
EXPLICIT = Valence(
    slug="explicit",
    label="Explicit",
    hue="graphite",
    hit_points=None,
    miss_points=None,
    bands=(Band(0, "Your push, this step."),),
    cue=Cue(),
)

VALENCES: dict[str, Valence] = {
    valence.slug: valence for valence in (POSITIVE, NEGATIVE, BINARY, EXPLICIT)
}


def find_valence(slug: str) -> Valence:
    """Give the valence of that name. Raises InvalidSetting, naming the known ones."""
    try:
        return VALENCES[slug]
    except KeyError:
        raise InvalidSetting(
            f"There is no valence {slug!r}. Known valences: {', '.join(VALENCES)}."
        ) from None
