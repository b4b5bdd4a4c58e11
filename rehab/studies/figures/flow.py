"""The flow of participants, as CONSORT 2010 draws it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rehab.studies.figures.canvas import COLORS, INK, MUTED, Canvas, shorten

WIDTH = 1000.0
LINE, PAD, GAP = 22.0, 12.0, 34.0


@dataclass(frozen=True, slots=True)
class Box:
    """A box: its heading and what stands below it."""

    heading: str
    lines: tuple[str, ...] = ()

    @property
    def height(self) -> float:
        """How high it is drawn."""
        return 2 * PAD + LINE * (1 + len(self.lines)) - 4


def draw_flow(first: Box, columns: Sequence[Sequence[Box]], title: str) -> str:
    """Return the figure: one box, and below it a column of boxes for each arm."""
    rows = max((len(column) for column in columns), default=0)
    heights = [max(column[row].height for column in columns) for row in range(rows)]
    total = 24 + first.height + GAP * rows + sum(heights) + (GAP if columns else 0)
    canvas = Canvas(WIDTH, total, title)
    _draw(canvas, first, WIDTH / 2, 12, 360, INK, first.height)
    if not columns:
        return canvas.to_text()
    wide = (WIDTH - 16) / len(columns)
    fork = 12 + first.height + GAP / 2
    centers = [8 + wide * (index + 0.5) for index in range(len(columns))]
    canvas.line(WIDTH / 2, 12 + first.height, WIDTH / 2, fork, MUTED, 1.5)
    canvas.line(centers[0], fork, centers[-1], fork, MUTED, 1.5)
    for arm, (center, column) in enumerate(zip(centers, columns, strict=True)):
        top, above = fork + GAP / 2, fork
        for box, height in zip(column, heights, strict=True):
            canvas.line(center, above, center, top, MUTED, 1.5)
            canvas.add(
                "path",
                d=f"M{center - 5:.1f} {top - 8:.1f}l5 8l5 -8",
                fill="none",
                stroke=MUTED,
                stroke_width=1.5,
            )
            _draw(canvas, box, center, top, min(wide - 16, 300), COLORS[arm % len(COLORS)], height)
            above, top = top + height, top + height + GAP
    return canvas.to_text()


def _draw(
    canvas: Canvas, box: Box, center: float, top: float, width: float, color: str, height: float
) -> None:
    paint = {"fill": "#fff", "stroke": color}
    canvas.rect(center - width / 2, top, width, height, rx=8, **paint, stroke_width=1.8)
    foot = top + PAD + 14
    room = width - 16
    canvas.words(center, foot, shorten(box.heading, room), size=15, anchor="middle", weight="700")
    for line in box.lines:
        foot += LINE
        canvas.words(center, foot, shorten(line, room, 13), size=13, anchor="middle", color=INK)
