"""The example steps in the preview of a feedback type: one or two for each band."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from rehab.training.feedback_bands import Band, Confetti
from rehab.training.valences import Valence

SCALE = 1.5  # the thermometer's end
TOP_Y, BOTTOM_Y = 30, 210  # where the scale ends and begins in the drawing; the goal lies at 90
SPREAD = (0.618, 0.755)  # additive recurrences that spread the pieces of confetti evenly
# Dots that stand for an amount of confetti.
AMOUNTS = {Confetti.NONE: 0, Confetti.LITTLE: 6, Confetti.MUCH: 14, Confetti.MOST: 26}


@dataclass(frozen=True, slots=True)
class PreviewStep:
    """A step as a patient would see it. ``level`` is its share of the scale, 0 to 1."""

    begins: str
    level: float
    is_hit: bool
    words: str
    emblem: str
    sign: str
    confetti: Confetti

    @property
    def y(self) -> float:
        """The height of the level in the drawing."""
        return round(BOTTOM_Y - (BOTTOM_Y - TOP_Y) * self.level, 1)

    @property
    def pieces(self) -> list[tuple[float, float, int]]:
        """The place and color of each piece of confetti."""
        return [
            (round(20 + 360 * (n * SPREAD[0] % 1)), round(8 + 70 * (n * SPREAD[1] % 1)), n % 3)
            for n in range(1, AMOUNTS[self.confetti] + 1)
        ]


def preview_bands(valence: Valence) -> Iterator[PreviewStep]:
    """Yield a typical step of each band; two of a band that has the goal in it."""
    ends = [band.from_performance for band in valence.bands[1:]]
    for band, end in zip(valence.bands, [*ends, None], strict=True):
        start = band.from_performance
        last = end if end is not None else max(start + 0.2, 1.2)
        for low, high in _split_at_goal(start, last):
            yield _make_step(valence, band, (low + high) / 2)


def _split_at_goal(start: float, end: float) -> Iterator[tuple[float, float]]:
    marks = [start, 1.0, end] if start < 1 < end else [start, end]
    yield from pairwise(marks)


def _make_step(valence: Valence, band: Band, performance: float) -> PreviewStep:
    hit = performance >= 1
    points = valence.points(hit) or 0
    return PreviewStep(
        begins=f"{100 * band.from_performance:.0f}",
        level=min(performance / SCALE, 1),
        is_hit=hit,
        words=next(iter(band.phrases), ""),
        emblem=valence.emblem(hit).value,
        sign=f"{'+' if points > 0 else '−'}{abs(points)}" if points else "",
        confetti=band.confetti,
    )
