"""Draws static/fonts/zero.woff2: the one digit that Atkinson Hyperlegible has only with a slash.

A slash is read as a canceled number, or an eight. Widths and stems are those of the face's other
digits. Needs `fonttools[woff]`, which nothing else of GARRY needs:
`python -m tests.support.zero_font`.
"""

from pathlib import Path

from fontTools.designspaceLib import AxisDescriptor
from fontTools.fontBuilder import FontBuilder
from fontTools.pens.ttGlyphPen import TTGlyphPen
from fontTools.ttLib.tables.TupleVariation import TupleVariation

TO = Path(__file__).parents[2] / "static/fonts/zero.woff2"
WIDTH, MIDDLE = 632, 316  # of tabular digits, in thousandths of the size
LIGHT = (316 - 64, 348, 54, 48)  # half width, half height; stem at the side, at top and bottom
BOLD = (316 - 26, 346, 165, 120)  # at weights 200 and 800
ROUND = 0.45  # 0.414 is an ellipse: a digit is a little squarer


def ring(half_width: float, half_height: float, *, inner: bool) -> list[tuple[float, float]]:
    """Return a closed contour's twelve points, each third one on the curve."""
    a, b = half_width, half_height
    quarter = [(a, 0.0), (a, ROUND * b), (ROUND * a, b)]
    points = []
    for turn in range(4):
        for x, y in quarter if turn % 2 == 0 else [(0.0, b), (-ROUND * a, b), (-a, ROUND * b)]:
            sign = 1 if turn < 2 else -1
            points.append((MIDDLE + sign * x, 334 + sign * y))
    return points if inner else [points[0], *points[:0:-1]]


def outline(
    half_width: float, half_height: float, side: float, top: float
) -> list[list[tuple[float, float]]]:
    """Return the outer contour and the inner one."""
    return [
        ring(half_width, half_height, inner=False),
        ring(half_width - side, half_height - top, inner=True),
    ]


def draw() -> None:
    """Write the font: one glyph, of weights 200 to 800."""
    pen = TTGlyphPen(None)
    for contour in outline(*LIGHT):
        pen.moveTo(contour[0])
        for index in (0, 3, 6, 9):
            first, second, last = contour[index + 1], contour[index + 2], contour[(index + 3) % 12]
            pen.qCurveTo(first, second, last)
        pen.closePath()
    zero = pen.glyph()
    empty = TTGlyphPen(None).glyph()
    font = FontBuilder(1000, isTTF=True)
    font.setupGlyphOrder([".notdef", "zero"])
    font.setupCharacterMap({ord("0"): "zero"})
    font.setupGlyf({".notdef": empty, "zero": zero})
    font.setupHorizontalMetrics({".notdef": (WIDTH, 0), "zero": (WIDTH, 64)})
    font.setupHorizontalHeader(ascent=984, descent=-316)
    font.setupNameTable({"familyName": "GARRY Zero", "styleName": "Regular"})
    font.setupOS2(sTypoAscender=984, sTypoDescender=-316, usWinAscent=984, usWinDescent=316)
    font.setupPost()
    font.setupFvar(
        [AxisDescriptor(tag="wght", name="Weight", minimum=200, default=200, maximum=800)], []
    )
    light = [point for contour in outline(*LIGHT) for point in contour]
    bold = [point for contour in outline(*BOLD) for point in contour]
    moved = [(round(b[0] - a[0]), round(b[1] - a[1])) for a, b in zip(light, bold, strict=True)]
    glyph_points = len(zero.coordinates)
    assert glyph_points == len(moved), (glyph_points, len(moved))
    font.setupGvar(
        {"zero": [TupleVariation({"wght": (0, 1, 1)}, [*moved, (0, 0), (0, 0), (0, 0), (0, 0)])]}
    )
    font.font.flavor = "woff2"
    font.save(TO)


if __name__ == "__main__":
    draw()
