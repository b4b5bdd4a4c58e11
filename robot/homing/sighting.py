"""What a camera saw in one frame."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from robot.wire.frames import to_number

Corners = tuple[tuple[float, float], ...]  # of a tag [px]: top left, then clockwise, as printed

FARTHEST_PX = 20_000.0


@dataclass(frozen=True, slots=True)
class Sighting:
    """The tags of one frame.

    Parameters
    ----------
    at_s
        When the camera delivered the frame [s], by the clock of this computer (``monotonic``).
    tags
        Number and corners of each tag in it; a number may come twice.
    size_px
        Width and height of the frame [px]; 0 where there was none.
    problem
        Why the frame is of no use, as a code; empty where it is.
    """

    at_s: float
    tags: tuple[tuple[int, Corners], ...] = ()
    size_px: tuple[int, int] = (0, 0)
    problem: str = ""

    def corners_of(self, tag: int) -> list[Corners]:
        """Return the corners of each tag with a number."""
        return [corners for number, corners in self.tags if number == tag]

    def to_line(self) -> str:
        """Return it as a line of JSON."""
        tags = [[number, [list(corner) for corner in corners]] for number, corners in self.tags]
        return json.dumps([self.at_s, tags, list(self.size_px), self.problem])


def read_sighting(line: str) -> Sighting:
    """Return the sighting of a line. Raises ValueError."""
    try:
        at_s, tags, (width, height), problem = json.loads(line)
        return Sighting(
            _number(at_s, math.inf),
            tuple((int(tag), _read_corners(corners)) for tag, corners in tags),
            (int(width), int(height)),
            str(problem),
        )
    except (TypeError, ValueError, OverflowError, RecursionError) as problem:
        raise ValueError(f"no sighting: {problem}") from None


def _number(value: Any, most: float) -> float:
    number = to_number(value, -most, most)
    if number is None:
        raise ValueError(f"no number: {value!r}")
    return number


def _read_corners(corners: Any) -> Corners:
    first, second, third, fourth = corners
    four = (first, second, third, fourth)
    return tuple((_number(x, FARTHEST_PX), _number(y, FARTHEST_PX)) for x, y in four)
