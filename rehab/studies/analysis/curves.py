"""Curves of learning and retention: how an arm's participants walked, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rehab.studies.analysis.comparison import mean_of
from rehab.studies.analysis.walks import Walk

BIN = 10  # strides of a point


@dataclass(frozen=True, slots=True)
class CurvePlace:
    """Where a point of a curve lies: the index of its visit, of its phase, and its bin there."""

    visit: int
    phase: int
    bin: int


Curve = dict[CurvePlace, float]


@dataclass(frozen=True, slots=True)
class Point:
    """A mean over participants with its 95 % band [% of baseline]; None of too few of them."""

    place: CurvePlace
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
                    curve[CurvePlace(visit, phase, place)] = mean
    return curve


def average(curves: Sequence[Curve]) -> list[Point]:
    """Return the mean curve of an arm's participants, with Student's interval at each place.

    Places that fewer than half of them reached are left out: they would show who was slow.
    """
    everywhere = {place for curve in curves for place in curve}
    points = []
    for place in sorted(everywhere, key=lambda place: (place.visit, place.phase, place.bin)):
        values = [curve[place] for curve in curves if place in curve]
        if 2 * len(values) >= len(curves):
            mean = mean_of(values)
            points.append(Point(place, len(values), mean.estimate, mean.low, mean.high))
    return points
