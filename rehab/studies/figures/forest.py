"""Effect sizes of all outcomes with their intervals, as a forest plot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rehab.sessions.reports.report_chart import round_steps
from rehab.studies.analysis.comparison import Difference
from rehab.studies.figures.canvas import GRID, INK, MUTED, QUIET, Canvas, number, shorten

WIDTH, ROW, TOP, FOOT = 1000.0, 30.0, 44.0, 46.0
LEFT, RIGHT = 420.0, 190.0
FAR = 3.0  # effects beyond are drawn at the edge


@dataclass(frozen=True, slots=True)
class ForestRow:
    """A line of the plot: a heading without a difference, or a difference."""

    words: str
    difference: Difference | None = None
    strong: bool = False


def draw_forest(rows: Sequence[ForestRow], title: str, x_axis: str) -> str:
    """Return the figure: one row each, effect sizes about a line at 0."""
    height = TOP + ROW * len(rows) + FOOT
    canvas = Canvas(WIDTH, height, title)
    ends = [
        value
        for row in rows
        if row.difference is not None and (effect := row.difference.effect) is not None
        for value in (effect.estimate, effect.low, effect.high)
        if value is not None
    ]
    far = min(FAR, max([0.8, *(abs(end) for end in ends)]))
    levels = round_steps(-far, far)
    bottom = TOP + ROW * len(rows)

    def x(value: float) -> float:
        inside = min(max(value, levels[0]), levels[-1])
        return LEFT + (WIDTH - LEFT - RIGHT) * (inside - levels[0]) / (levels[-1] - levels[0])

    for level in levels:
        strong = level == 0
        canvas.line(x(level), TOP, x(level), bottom, MUTED if strong else GRID, 1 + strong / 2)
        canvas.words(x(level), bottom + 20, number(level), size=13, anchor="middle", color=MUTED)
    canvas.words(
        (LEFT + WIDTH - RIGHT) / 2, bottom + 40, x_axis, size=14, anchor="middle", color=MUTED
    )
    for index, row in enumerate(rows):
        _draw_row(canvas, row, TOP + ROW * index, x)
    return canvas.to_text()


def _draw_row(canvas: Canvas, row: ForestRow, top: float, x: Callable[[float], float]) -> None:
    middle = top + ROW / 2
    if row.difference is None:
        canvas.rect(8, top + 2, WIDTH - 16, ROW - 4, fill=QUIET)
        canvas.words(14, middle + 5, row.words, weight="700")
        return
    canvas.words(32, middle + 5, shorten(row.words, LEFT - 48))
    effect = row.difference.effect
    if effect is None:
        canvas.words(WIDTH - RIGHT + 14, middle + 5, "–", size=14, color=MUTED)
        return
    color = INK if row.strong else MUTED
    label = number(round(effect.estimate, 2))
    if effect.low is not None and effect.high is not None:
        canvas.line(x(effect.low), middle, x(effect.high), middle, color, 2.6)
        label += f"  [{number(round(effect.low, 2))}, {number(round(effect.high, 2))}]"
    at, size = x(effect.estimate), 7.0 if row.strong else 5.5
    canvas.rect(at - size, middle - size, 2 * size, 2 * size, fill=color)
    canvas.words(WIDTH - RIGHT + 14, middle + 5, label, size=14, color=INK)
