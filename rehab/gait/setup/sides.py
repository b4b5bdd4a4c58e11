"""Which leg a plate is of, by the name of its column."""

from __future__ import annotations

from collections.abc import Sequence

FIRST = {
    "left": ("left", "l_", "l.", "l ", "1_", "fp1"),
    "right": ("right", "r_", "r.", "r ", "2_"),
}
LAST = {"left": ("left", "_l", ".l", " l", "1"), "right": ("right", "_r", ".r", " r", "2")}
OTHER = {"left": "right", "right": "left"}


def name_sides(columns: Sequence[str]) -> list[str]:
    """Return the leg of each of one or two plates; the first is left where names tell nothing."""
    sides = [_find_side(column.lower()) for column in columns]
    if len(sides) == 1:
        return [sides[0] or "left"]
    one, two = sides
    if one == two:
        one, two = "left", ""
    if not one:
        one = OTHER[two]
    return [one, OTHER[one]]


def _find_side(name: str) -> str:
    """Return the leg that a name tells, empty if it tells none or both."""
    found = [
        side
        for side in FIRST
        if side in name or name.startswith(FIRST[side]) or name.endswith(LAST[side])
    ]
    return found[0] if len(found) == 1 else ""
