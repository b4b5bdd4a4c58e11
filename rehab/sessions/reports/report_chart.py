"""The chart of a session's report: every stride, as SVG paths."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from itertools import groupby
from typing import Any

LETTER_WIDTH = 0.6  # of bold words on average, by their size
FAR_FROM_ZERO = 0.3  # of the highest value; what lies beyond fills the drawing
MAX_ROWS = 4  # of phases' names above each other


@dataclass(frozen=True, slots=True)
class Format:
    """Sizes of a drawing, in units of its view box."""

    name: str
    width: float
    height: float
    letter: float
    ring: float
    margin: float
    steps: int  # of the stride's axis, at most


PAPER = Format("paper", 1000, 215, 17, 2.6, 24, 10)
PHONE = Format("phone", 300, 230, 13, 1.8, 12, 4)  # as many units as a phone has pixels


def draw_chart(chart: dict[str, Any], size: Format = PAPER) -> dict[str, Any]:
    """Return all strides of the trained leg against the goal, as paths that print in gray.

    At or above the goal is a disc, below a ring, without a goal a cross, close to it a dash; an
    invalid stride is a mark on the axis. The goal is a line, phases without feedback are shaded.
    ``chart`` is the result of ``review.stride_chart``. Returns {} without strides.
    """
    strides = chart["strides"]
    numbers, values, goals = strides["number"], strides["value"], strides["goal"]
    if not numbers:
        return {}
    width, height, ring = size.width, size.height, size.ring
    known = [value for value in (*values, *goals) if value is not None]
    highest: float = max(known, default=1.0)
    top = 1.08 * highest if highest > 0 else 1.0
    lowest: float = min(known, default=0.0)
    bottom = lowest - 0.15 * (top - lowest) if lowest > FAR_FROM_ZERO * top else 0.0
    levels = [value for value in round_steps(bottom, top, most=7) if bottom < value < top]
    first: int = numbers[0]
    span: int = max(1, numbers[-1] - first)

    def x(number: float) -> float:
        return size.margin + (width - 2 * size.margin) * (number - first) / span

    def y(value: float) -> float:
        return height - height * max(value - bottom, 0.0) / (top - bottom)

    paths: defaultdict[str, list[str]] = defaultdict(list)
    verdicts = zip(numbers, values, strides["hit"], strides["close"], strict=True)
    for number, value, hit, close in verdicts:
        at = x(number)
        if value is None:
            paths["lost"].append(f"M{at:.1f} {height - 6:.0f}v6")
        elif hit is None:
            paths["free"].append(f"M{at - 2.4:.1f} {y(value):.1f}h4.8m-2.4 -2.4v4.8")
        elif close:
            paths["close"].append(f"M{at - 2.4:.1f} {y(value):.1f}h4.8")
        elif hit:
            paths["hit"].append(f"M{at:.1f} {y(value):.1f}h0")
        else:
            up = y(value)
            paths["miss"].append(
                f"M{at - ring:.1f} {up:.1f}a{ring} {ring} 0 1 0 {2 * ring} 0"
                f"a{ring} {ring} 0 1 0 {-2 * ring} 0"
            )
    runs = [
        (goal, [number for number, _same in run])
        for goal, run in groupby(zip(numbers, goals, strict=True), lambda pair: pair[1])
    ]
    line = ""
    for before, (goal, run) in zip([(None, [0]), *runs], runs, strict=False):
        if goal is not None:
            line += f"V{y(goal):.1f}" if before[0] else f"M{x(run[0]):.1f} {y(goal):.1f}"
            line += f"H{x(run[-1] + 1 if run[-1] != numbers[-1] else run[-1]):.1f}"
    phases = [
        {
            "name": phase["name"],
            "x": round(x(phase["from"]), 1),
            "width": round(max(1.0, x(phase["to"]) - x(phase["from"])), 1),
            "quiet": not phase["feedback"],
        }
        for phase in chart["phases"]
    ]
    rows = _name_phases(phases, size)
    words = [f"{value:g}" for value in levels]
    left = 10 + size.letter * LETTER_WIDTH * max(map(len, words), default=1)
    above, below = size.letter * (1.25 * rows + 0.3), size.letter * 1.8
    return {
        **{name: "".join(parts) for name, parts in paths.items()},
        "goal": line,
        "size": size,
        "box": f"{-left:.0f} {-above:.0f} {width + left:.0f} {height + above + below:.0f}",
        "phases": phases,
        "levels": [
            {"y": round(y(value), 1), "words": word}
            for value, word in zip(levels, words, strict=True)
        ],
        "ticks": [
            {"x": round(x(number), 1), "words": f"{number:.0f}"}
            for number in round_steps(0, numbers[-1], most=size.steps)
            if first <= number <= numbers[-1] and number == int(number)
        ],
        "strides": len(numbers),
    }


def _name_phases(phases: list[dict[str, Any]], size: Format) -> int:
    """Add to phases where their names stand, those of narrow ones above the next; return the rows.

    A phase's edge goes up to its name, past the rows below. A name for which there is no room in
    any row is left out: the table has it.
    """
    begins = [size.width] * MAX_ROWS
    used = 1
    for phase in reversed(phases):
        wide = size.letter * LETTER_WIDTH * len(phase["name"])
        at = max(0.0, min(phase["x"], size.width - wide))
        rows = (row for row in range(MAX_ROWS) if at + wide <= min(begins[row:]))
        row = next(rows, None)
        if row is None:
            continue
        begins[row] = at - size.letter / 2
        used = max(used, row + 1)
        phase["up"] = round(size.letter * (0.4 + 1.25 * row), 1)
        phase["at"] = round(at, 1)
    return used


def round_steps(low: float, high: float, most: int = 6) -> list[float]:
    """Return round numbers that span a range, at most so many steps apart."""
    span = high - low if high > low else 1.0
    size = 10.0 ** math.floor(math.log10(span / most))
    step = next(n * size for n in (1, 2, 2.5, 5, 10, 20) if span / (n * size) <= most)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * count, 10) for count in range(first, last + 1)]
