"""Curves of learning and retention: how an arm's participants walked, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rehab.studies.analysis.comparison import CONFIDENCE, MIN_PARTICIPANTS, RESAMPLES, SEED
from rehab.studies.analysis.walks import Floats, Walk

BIN = 10  # strides of a point


@dataclass(frozen=True, slots=True)
class Place:
    """Where a point of a curve lies: the index of its visit, of its phase, and its bin there."""

    visit: int
    phase: int
    bin: int


Curve = dict[Place, float]


@dataclass(frozen=True, slots=True)
class Point:
    """A mean over participants with its 95 % band [% of baseline]; None of too few of them."""

    place: Place
    participants: int
    mean: float
    low: float | None
    high: float | None


def curve_of(walks: Sequence[Walk | None]) -> Curve:
    """Return a participant's means of ten strides each, in percent of each visit's own baseline.

    ``walks``: those of the visits in their order, None for one that was missed.
    """
    curve: Curve = {}
    for visit, walk in enumerate(walks):
        if walk is None or walk.baseline is None:
            continue
        for phase in range(len(walk.phases)):
            here = np.flatnonzero(walk.phase == phase)
            for place, first in enumerate(range(0, len(here), BIN)):
                chosen = here[first : first + BIN]
                values = walk.value[chosen][walk.valid[chosen]]
                if len(values) > BIN // 2 or (len(values) and len(here) <= BIN // 2):
                    mean = 100 * float(values.mean()) / walk.baseline
                    curve[Place(visit, phase, place)] = mean
    return curve


def average(curves: Sequence[Curve]) -> list[Point]:
    """Return the mean curve of an arm's participants, with the band of a bootstrap over them.

    Places that fewer than half of them reached are left out: they would show who was slow.
    """
    everywhere = {place for curve in curves for place in curve}
    places = sorted(everywhere, key=lambda place: (place.visit, place.phase, place.bin))
    table = np.array([[curve.get(place, np.nan) for place in places] for curve in curves])
    if not table.size:
        return []
    known = np.isfinite(table)
    lows, highs = _band(table, known)
    points = []
    for column, place in enumerate(places):
        count = int(known[:, column].sum())
        if 2 * count < len(curves):
            continue
        mean = float(table[known[:, column], column].mean())
        told = count >= MIN_PARTICIPANTS
        low, high = (float(lows[column]), float(highs[column])) if told else (None, None)
        points.append(Point(place, count, mean, low, high))
    return points


def _band(table: Floats, known: Floats) -> tuple[Floats, Floats]:
    """Return the percentiles of the resampled means, shape (places,) each."""
    drawn = np.random.default_rng(SEED).integers(0, len(table), (RESAMPLES, len(table)))
    means = np.empty((RESAMPLES, table.shape[1]))
    filled = np.where(known, table, 0.0)
    for row, chosen in enumerate(drawn):
        counts = known[chosen].sum(axis=0)
        means[row] = filled[chosen].sum(axis=0) / np.maximum(counts, 1)
        means[row][counts == 0] = np.nan
    tail = (1 - CONFIDENCE) / 2
    low, high = np.nanquantile(means, [tail, 1 - tail], axis=0)
    return low, high
