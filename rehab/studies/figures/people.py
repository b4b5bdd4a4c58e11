"""Every participant's figure by arm, beside each arm's mean with its interval."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rehab.sessions.reports.report_chart import round_steps
from rehab.studies.analysis.findings import OutcomeResult
from rehab.studies.figures.canvas import COLORS, INK, LEFT, MUTED, RIGHT, Canvas, number, shorten

WIDTH, HEIGHT = 1000.0, 400.0
TOP, BOTTOM = 44.0, 62.0
DOT = 4.6


def draw_people(
    finding: OutcomeResult,
    values: Mapping[str, Mapping[str, float]],
    labels: Mapping[str, str],
    title: str,
    y_axis: str,
    *,
    joined: bool,
) -> str:
    """Return the figure. ``values`` by arm and participant; ``joined``: a line for each person."""
    canvas = Canvas(WIDTH, HEIGHT, title)
    canvas.words(LEFT - 50, 24, y_axis, size=14, color=MUTED)
    everything = [value for of_arm in values.values() for value in of_arm.values()]
    if not everything:
        return canvas.to_text()
    means = [figure.mean for figure in finding.arms if figure.mean is not None]
    everything += [end for mean in means for end in (mean.low, mean.high) if end is not None]
    levels = round_steps(min(*everything, 0.0), max(*everything, 0.0))
    bottom = HEIGHT - BOTTOM

    def y(value: float) -> float:
        return bottom - (bottom - TOP) * (value - levels[0]) / (levels[-1] - levels[0])

    canvas.grid(levels, y, strong=0)
    wide = (WIDTH - LEFT - RIGHT) / len(labels)
    centers = {arm: LEFT + wide * (index + 0.5) for index, arm in enumerate(labels)}
    if joined:
        _join(canvas, values, centers, y)
    for index, figure in enumerate(finding.arms):
        center = centers[figure.arm]
        for value, aside in _swarm(sorted(values[figure.arm].values()), y):
            canvas.mark(center + aside - 0.12 * wide, y(value), index, DOT, 0.75)
        name = shorten(labels[figure.arm], wide - 8)
        canvas.words(center, bottom + 24, name, anchor="middle", weight="700")
        count = f"n = {figure.participants}"
        if figure.missing:
            count += f" (−{figure.missing})"
        canvas.words(center, bottom + 44, count, size=13, anchor="middle", color=MUTED)
        if figure.mean is not None:
            aside = center + 0.26 * wide
            color = COLORS[index % len(COLORS)]
            if figure.mean.low is not None and figure.mean.high is not None:
                canvas.line(aside, y(figure.mean.low), aside, y(figure.mean.high), color, 3)
            canvas.mark(aside, y(figure.mean.estimate), index, 8)
            label = number(round(figure.mean.estimate, 1))
            place = y(figure.mean.estimate) + 5
            canvas.words(aside + 14, place, label, color=INK, weight="700", halo=True)
    return canvas.to_text()


def _swarm(values: list[float], y: Callable[[float], float]) -> list[tuple[float, float]]:
    """Return each value with how far aside it stands so that no two dots overlap."""
    placed: list[tuple[float, float]] = []
    for value in values:
        height = y(value)
        near = [aside for other, aside in placed if abs(other - height) < 2 * DOT]
        steps = (side * n * 2 * DOT for n in range(len(near) + 1) for side in (1, -1))
        free = (s for s in steps if all(abs(s - taken) >= 2 * DOT - 0.1 for taken in near))
        placed.append((height, next(free)))
    return [(value, aside) for value, (_height, aside) in zip(values, placed, strict=True)]


def _join(
    canvas: Canvas,
    values: Mapping[str, Mapping[str, float]],
    centers: Mapping[str, float],
    y: Callable[[float], float],
) -> None:
    people = {code for of_arm in values.values() for code in of_arm}
    for code in sorted(people):
        walked = [(centers[arm], values[arm][code]) for arm in centers if code in values[arm]]
        points = [f"{x:.1f} {y(value):.1f}" for x, value in walked]
        if len(points) > 1:
            canvas.add("path", d="M" + "L".join(points), fill="none", stroke="#b9b9b4")
