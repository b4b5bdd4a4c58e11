"""The course of a figure as a small line, without axes."""

from __future__ import annotations

from collections.abc import Sequence

SIZE = (120, 32)  # of the drawing, in its own units
EDGE = 4  # room for the dots at its ends


def draw_spark(
    values: Sequence[float], *, higher_is_better: bool, beside: Sequence[float] = ()
) -> list[str]:
    """Return the points of a line in a drawing of the size `SIZE`, better values higher.

    ``beside``: the values of another line on the same scale.
    """
    scale = [*values, *beside]
    low, high = min(scale, default=0.0), max(scale, default=0.0)
    span = (high - low) or 1.0
    width, height = SIZE
    points = []
    for place, value in enumerate(values):
        share = (value - low) / span if high > low else 0.5
        share = share if higher_is_better else 1 - share
        x = EDGE + place * (width - 2 * EDGE) / max(1, len(values) - 1)
        points.append(f"{x:.1f},{EDGE + (1 - share) * (height - 2 * EDGE):.1f}")
    return points
