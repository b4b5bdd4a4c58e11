"""Curves of learning and retention: each arm's mean with its band, visit by visit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from rehab.sessions.reports.report_chart import round_steps
from rehab.studies.analysis.curves import Point
from rehab.studies.figures.canvas import COLORS, LEFT, MUTED, QUIET, RIGHT, Canvas

WIDTH, PANEL = 1000.0, 160.0  # a panel for each arm, its name above it
HEAD, NAME, BOTTOM, BETWEEN = 78.0, 34.0, 36.0, 18.0


@dataclass(frozen=True, slots=True)
class PhaseLabel:
    """A phase on the axis: its name, and whether it gives feedback."""

    name: str
    feedback: bool


@dataclass(frozen=True, slots=True)
class CurveLabels:
    """What a figure says, in the reader's language."""

    title: str
    y_axis: str
    x_axis: str
    visit: str  # with a place for its number: "Visit {number}"


def draw_curves(
    curves: Mapping[str, Sequence[Point]],
    labels: Mapping[str, str],
    phases: Sequence[PhaseLabel],
    words: CurveLabels,
) -> str:
    """Return the figure. ``curves`` and ``labels`` by arm, in the order of the arms."""
    everything = [point for points in curves.values() for point in points]
    height = HEAD + len(curves) * (NAME + PANEL) + BOTTOM
    canvas = Canvas(WIDTH, height, words.title)
    if not everything:
        canvas.legend(LEFT, 26, [labels[arm] for arm in curves])
        return canvas.to_text()
    seen = [value for point in everything for value in (point.mean, point.low, point.high) if value]
    levels = round_steps(min(*seen, 95.0), max(*seen, 105.0))
    places = _lay_out(everything, words)
    _name_ground(canvas, places, phases)
    canvas.words(WIDTH - RIGHT, HEAD + NAME - 10, words.y_axis, size=14, anchor="end", color=MUTED)
    canvas.words(WIDTH - RIGHT, height - 10, words.x_axis, size=14, anchor="end", color=MUTED)
    for arm, (code, points) in enumerate(curves.items()):
        top = HEAD + arm * (NAME + PANEL) + NAME
        canvas.mark(LEFT + 6, top - 15, arm, 6)
        canvas.words(LEFT + 20, top - 10, labels[code], weight="700")
        _draw_panel(canvas, arm, points, (places, phases, levels), top)
    return canvas.to_text()


def _draw_panel(
    canvas: Canvas,
    arm: int,
    points: Sequence[Point],
    axes: tuple[_Places, Sequence[PhaseLabel], Sequence[float]],
    top: float,
) -> None:
    """Draw one arm's mean with its band, on the axes that all arms share."""
    places, phases, levels = axes
    bottom = top + PANEL

    def y(value: float) -> float:
        return bottom - PANEL * (value - levels[0]) / (levels[-1] - levels[0])

    _draw_ground(canvas, places, phases, top)
    canvas.grid(levels, y, strong=100)
    for run in _runs(points):
        _draw_band(canvas, arm, [(places.x(point), point) for point in run], y)
        path = "M" + "L".join(f"{places.x(p):.1f} {y(p.mean):.1f}" for p in run)
        canvas.stroke(path if len(run) > 1 else path + "h.1", arm)
        for point in run[:: max(1, len(run) // 6)]:
            canvas.mark(places.x(point), y(point.mean), arm, 4)


@dataclass(frozen=True, slots=True)
class _Places:
    """Where bins lie: the first x and the count of bins of each visit's phases."""

    starts: dict[tuple[int, int], tuple[float, int]]
    step: float
    visits: dict[int, str]

    def x(self, point: Point) -> float:
        start, _bins = self.starts[point.place.visit, point.place.phase]
        return start + (point.place.bin + 0.5) * self.step


def _lay_out(points: Sequence[Point], words: CurveLabels) -> _Places:
    bins: dict[tuple[int, int], int] = {}
    for point in points:
        key = point.place.visit, point.place.phase
        bins[key] = max(bins.get(key, 0), point.place.bin + 1)
    visits = sorted({visit for visit, _phase in bins})
    room = WIDTH - LEFT - RIGHT - BETWEEN * (len(visits) - 1)
    step = room / sum(bins.values())
    starts, x = {}, LEFT
    for visit in visits:
        for key in sorted(key for key in bins if key[0] == visit):
            starts[key] = (x, bins[key])
            x += step * bins[key]
        x += BETWEEN
    shown = {visit: words.visit.format(number=visit + 1) for visit in visits}
    return _Places(starts, step, shown)


def _draw_ground(canvas: Canvas, places: _Places, phases: Sequence[PhaseLabel], top: float) -> None:
    """Shade what was walked without feedback."""
    for (_visit, phase), (x, bins) in places.starts.items():
        if not phases[phase].feedback:
            canvas.rect(x, top, bins * places.step, PANEL, fill=QUIET)


def _name_ground(canvas: Canvas, places: _Places, phases: Sequence[PhaseLabel]) -> None:
    """Name visits above all panels, and their phases on as many lines as keep them apart."""
    ends = [0.0, 0.0, 0.0]  # of the last name on each line
    for (visit, phase), (x, bins) in places.starts.items():
        name, middle = phases[phase].name, x + bins * places.step / 2
        half = 3.8 * len(name)
        line = next((line for line, end in enumerate(ends) if end < middle - half), 2)
        ends[line] = middle + half
        foot = HEAD - 42 + 14 * line
        canvas.words(middle, foot, name, size=13, anchor="middle", color=MUTED)
        if phase == 0 and len(places.visits) > 1:
            canvas.words(x, HEAD - 60, places.visits[visit], weight="700")


def _runs(points: Sequence[Point]) -> list[list[Point]]:
    """Return the points that a line joins: those of one phase, without a hole."""
    numbered = enumerate(points)
    return [
        [point for _index, point in run]
        for _key, run in groupby(
            numbered,
            key=lambda pair: (
                pair[1].place.visit,
                pair[1].place.phase,
                pair[1].place.bin - pair[0],
            ),
        )
    ]


def _draw_band(
    canvas: Canvas, arm: int, run: list[tuple[float, Point]], y: Callable[[float], float]
) -> None:
    known = [(x, p.low, p.high) for x, p in run if p.low is not None and p.high is not None]
    if len(known) < 2:
        return
    upper = [f"{x:.1f} {y(high):.1f}" for x, _low, high in known]
    lower = [f"{x:.1f} {y(low):.1f}" for x, low, _high in reversed(known)]
    path = "M" + "L".join([*upper, *lower]) + "Z"
    canvas.add("path", d=path, fill=COLORS[arm % len(COLORS)], opacity=0.15)
