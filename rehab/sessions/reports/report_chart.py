"""The chart of a session's report: every stride, as SVG paths."""

from __future__ import annotations

import math
from collections import defaultdict
from itertools import groupby
from typing import Any

# In units of the view box.
WIDTH, HEIGHT, MARGIN = 1000.0, 250.0, 18.0
RING = 2.6


def draw_chart(chart: dict[str, Any]) -> dict[str, Any]:
    """Return all strides of the trained leg against the goal, as paths that print in gray.

    At or above the goal is a disc, below a ring, without a goal a cross, close to it a dash; an
    invalid stride is a mark below the axis. The goal is a line, phases without feedback are shaded.
    ``chart`` is the result of ``review.stride_chart``. Returns {} without strides.
    """
    strides = chart["strides"]
    numbers, shown, goals = strides["number"], strides["shown"], strides["goal"]
    if not numbers:
        return {}
    known = [value for value in (*shown, *goals) if value is not None]
    highest: float = max(known, default=1.0)
    top = 1.08 * highest if highest > 0 else 1.0
    levels = [value for value in round_steps(0, top, most=7) if 0 < value < top]
    first: int = numbers[0]
    span: int = max(1, numbers[-1] - first)

    def x(number: float) -> float:
        return MARGIN + (WIDTH - 2 * MARGIN) * (number - first) / span

    def y(value: float) -> float:
        return HEIGHT - HEIGHT * max(value, 0.0) / top

    paths: defaultdict[str, list[str]] = defaultdict(list)
    verdicts = zip(numbers, shown, strides["hit"], strides["close"], strict=True)
    for number, value, hit, close in verdicts:
        at = x(number)
        if value is None:
            paths["lost"].append(f"M{at:.1f} {HEIGHT:.0f}v6")
        elif hit is None:
            paths["free"].append(f"M{at - 2.4:.1f} {y(value):.1f}h4.8m-2.4 -2.4v4.8")
        elif close:
            paths["close"].append(f"M{at - 2.4:.1f} {y(value):.1f}h4.8")
        elif hit:
            paths["hit"].append(f"M{at:.1f} {y(value):.1f}h0")
        else:
            up = y(value)
            paths["miss"].append(
                f"M{at - RING:.1f} {up:.1f}a{RING} {RING} 0 1 0 {2 * RING} 0"
                f"a{RING} {RING} 0 1 0 {-2 * RING} 0"
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
    return {
        **{name: "".join(parts) for name, parts in paths.items()},
        "goal": line,
        "phases": [
            {
                "name": phase["name"],
                "x": round(x(phase["from"]), 1),
                "width": round(max(1.0, x(phase["to"]) - x(phase["from"])), 1),
                "quiet": not phase["feedback"],
            }
            for phase in chart["phases"]
        ],
        "levels": [{"y": round(y(value), 1), "words": f"{value:g}"} for value in levels],
        "first": numbers[0],
        "last": numbers[-1],
        "strides": len(numbers),
    }


def round_steps(low: float, high: float, most: int = 6) -> list[float]:
    """Return round numbers that span a range, at most so many steps apart."""
    span = high - low if high > low else 1.0
    size = 10.0 ** math.floor(math.log10(span / most))
    step = next(n * size for n in (1, 2, 2.5, 5, 10, 20) if span / (n * size) <= most)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * count, 10) for count in range(first, last + 1)]
