"""A tag to print, in its true size. Needs OpenCV."""

from __future__ import annotations

from robot.homing.detector import MODULES, tag_modules
from robot.homing.home_view import FAMILY

# Of A4, the sheet that most printers have [mm]; a larger tag gets a larger sheet.
WIDTH_MM, HEIGHT_MM = 210.0, 297.0
BESIDE_MODULES = 1.0  # white beside the black edge, without which nothing finds it
RULER_MM = 100


def draw_sheet(tag: int, size_m: float) -> str:
    """Return the sheet as SVG: the tag, its number and size, and a ruler to check the print by.

    Parameters
    ----------
    tag
        Its number in the family.
    size_m
        Side of its black square [m].
    """
    side = 1000 * size_m
    module = side / MODULES
    width = max(WIDTH_MM, side + 2 * BESIDE_MODULES * module)
    height = max(HEIGHT_MM, side + 2 * BESIDE_MODULES * module + 60)
    left, top = (width - side) / 2, max(20.0, BESIDE_MODULES * module)
    # One path, since between squares of their own a printer may leave hairlines.
    black = "".join(
        f"M{left + column * module:g} {top + row * module:g}h{module:g}v{module:g}h{-module:g}z"
        for row, line in enumerate(tag_modules(tag))
        for column, is_black in enumerate(line)
        if is_black
    )
    ruler_mm = top + side + BESIDE_MODULES * module + 20
    marks = "".join(
        f"M{(width - RULER_MM) / 2 + at:g} {ruler_mm:g}v{-6 if at % 50 == 0 else -3}"
        for at in range(0, RULER_MM + 1, 10)
    )
    return f"""<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" \
viewBox="0 0 {width:g} {height:g}">
<rect width="100%" height="100%" fill="white"/>
<path d="{black}" fill="black" shape-rendering="crispEdges"/>
<path d="M{(width - RULER_MM) / 2:g} {ruler_mm:g}h{RULER_MM}{marks}" stroke="black" \
stroke-width="0.3" fill="none"/>
<text x="50%" y="{ruler_mm + 7:g}" text-anchor="middle" font-family="sans-serif" font-size="5">\
The line above: {RULER_MM} mm. The black square: {side:g} mm.</text>
<text x="50%" y="{ruler_mm + 15:g}" text-anchor="middle" font-family="sans-serif" font-size="5">\
GARRY, {FAMILY}, tag {tag}. Print at 100 %, matt; glue it flat; this side up.</text>
</svg>
"""
