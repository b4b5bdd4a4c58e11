"""What all figures are drawn with: a white sheet, one type, colors with shapes and dashes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from xml.sax.saxutils import escape, quoteattr

FONT = "'Atkinson Hyperlegible Next', 'Atkinson Hyperlegible', Roboto, Arial, sans-serif"
INK, MUTED, GRID, QUIET = "#1c1c1a", "#595955", "#dededa", "#f1f1ed"
# After Okabe & Ito (2008), dark enough for 4.5:1 on white; never alone: each arm also has a shape
# and a dash of its own.
COLORS = ("#0068a3", "#b84c00", "#00705a", "#98437e", "#4d4d4d", "#7a6000", "#16324f", "#8c1d1d")
DASHES = ("", "9 4", "2.5 3.5", "12 4 2.5 4", "5 2.5", "1.5 2.5", "16 5", "7 3 2 3 2 3")
LEFT, RIGHT = 62.0, 16.0  # margins beside a chart
LETTER = 0.5  # mean width of a letter by the type's size


class Canvas:
    """A figure under way, in its own units; ``to_text`` is the whole document."""

    def __init__(self, width: float, height: float, title: str) -> None:
        self.width, self.height = width, height
        self._parts = [
            f"<title>{escape(title)}</title>",
            f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>',
        ]

    def add(self, tag: str, inner: str = "", /, **attributes: float | str) -> None:
        """Add an element; `_` in an attribute's name stands for `-`."""
        written = "".join(
            f" {name.rstrip('_').replace('_', '-')}={quoteattr(_text(value))}"
            for name, value in attributes.items()
            if value != ""
        )
        self._parts.append(f"<{tag}{written}>{inner}</{tag}>" if inner else f"<{tag}{written}/>")

    def line(
        self, x1: float, y1: float, x2: float, y2: float, color: str = GRID, width: float = 1.0
    ) -> None:
        """Draw a straight line."""
        self.add(
            "path", d=f"M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}", stroke=color, stroke_width=width
        )

    def rect(
        self, x: float, y: float, width: float, height: float, **attributes: float | str
    ) -> None:
        """Draw a rectangle from its upper left corner."""
        place = {"x": x, "y": y, "width": width, "height": height}
        self.add("rect", **{name: round(value, 1) for name, value in place.items()}, **attributes)

    def grid(self, levels: Sequence[float], y: Callable[[float], float], strong: float) -> None:
        """Draw a line at each level from the left margin on, one of them strong, with numbers."""
        for level in levels:
            color, width = (MUTED, 1.5) if level == strong else (GRID, 1.0)
            self.line(LEFT, y(level), self.width - RIGHT, y(level), color, width)
            self.words(LEFT - 8, y(level) + 5, number(level), size=14, anchor="end", color=MUTED)

    def words(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = 15,
        anchor: str = "start",
        color: str = INK,
        weight: str = "",
        halo: bool = False,
    ) -> None:
        """Write a line of text whose foot is at y. ``halo``: white about it, over other lines."""
        about: dict[str, float | str] = (
            {"stroke": "#fff", "stroke_width": 4, "paint_order": "stroke"} if halo else {}
        )
        self.add(
            "text",
            escape(text),
            x=round(x, 1),
            y=round(y, 1),
            font_size=size,
            text_anchor=anchor,
            fill=color,
            font_weight=weight,
            **about,
        )

    def mark(self, x: float, y: float, arm: int, size: float = 5.0, opacity: float = 1.0) -> None:
        """Draw an arm's shape: disc, square, triangle, diamond, and the same as outlines."""
        color, hollow = COLORS[arm % len(COLORS)], arm % 8 >= 4
        paint: dict[str, float | str] = {
            "fill": "#fff" if hollow else color,
            "stroke": color if hollow else "#fff",
            "stroke_width": 2 if hollow else 0.8,
            "opacity": "" if opacity == 1 else opacity,
        }
        if arm % 4 == 0:
            self.add("circle", cx=round(x, 1), cy=round(y, 1), r=size, **paint)
            return
        shapes = {
            1: [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
            2: [(0, -1.2), (1.1, 0.9), (-1.1, 0.9)],
            3: [(0, -1.25), (1.25, 0), (0, 1.25), (-1.25, 0)],
        }
        corners = [(x + size * dx, y + size * dy) for dx, dy in shapes[arm % 4]]
        path = "M" + "L".join(f"{cx:.1f} {cy:.1f}" for cx, cy in corners) + "Z"
        self.add("path", d=path, stroke_linejoin="round", **paint)

    def legend(self, x: float, y: float, labels: Sequence[str], *, dashed: bool = False) -> float:
        """Write the arms' names with their shapes, in rows; return the foot of the last one."""
        left = x
        for arm, label in enumerate(labels):
            wide = 44 + LETTER * 15 * len(label) + 20
            if left > x and left + wide > self.width - 12:
                left, y = x, y + 24
            if dashed:
                self.stroke(f"M{left:.1f} {y - 5:.1f}h34", arm)
            self.mark(left + 17, y - 5, arm)
            self.words(left + 44, y, label)
            left += wide
        return y

    def stroke(self, path: str, arm: int) -> None:
        """Draw a line in an arm's color and dash."""
        self.add(
            "path",
            d=path,
            fill="none",
            stroke=COLORS[arm % len(COLORS)],
            stroke_width=2.4,
            stroke_dasharray=DASHES[arm % len(DASHES)],
            stroke_linejoin="round",
        )

    def to_text(self) -> str:
        """Return the SVG document."""
        body = "\n".join(self._parts)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width:g} {self.height:g}" '
            f'role="img" font-family="{FONT}">\n{body}\n</svg>\n'
        )


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def number(value: float) -> str:
    """Return a number as an axis has it, with a minus sign."""
    return f"{value:g}".replace("-", "−")


def shorten(text: str, width: float, size: float = 15) -> str:
    """Return a text that fits into a width, with an ellipsis where it does not."""
    most = max(1, int(width / (LETTER * size)))
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"
