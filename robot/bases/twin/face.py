"""A look as a picture: what a screen on a base's mast shows, as the avatar's page draws it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from PIL import Image, ImageDraw

from robot.motion.face_and_arms import HAPPY, MOUTHS, Look

# The head of the avatar's drawing (robot/bases/face/page.html), with room to tilt [px].
LEFT, TOP, WIDTH, HEIGHT = 94, 72, 212, 150
SCALE = 3
PAPER, HEAD, SKIN, INK, HAND = "#f4f1ea", "#5b95b8", "#f8fbfd", "#22313a", "#f2b84b"
EYES_X, EYES_Y, EYE_PX = (172, 228), 134, 11

Point = tuple[float, float]


class _Pen:
    """Draws in the head's frame, tilted and lowered as the look has it."""

    def __init__(self, look: Look) -> None:
        self.image = Image.new("RGB", (WIDTH * SCALE, HEIGHT * SCALE), PAPER)
        self._draw = ImageDraw.Draw(self.image)
        turn_rad = math.radians(look.tilt_deg)
        self._cos, self._sin, self._down = math.cos(turn_rad), math.sin(turn_rad), 16 * look.nod

    def _place(self, points: Iterable[Point]) -> list[Point]:
        placed = []
        for x, y in points:
            across, up = x - 200, y - 210  # the neck, about which the head tilts
            turned = (across * self._cos - up * self._sin, across * self._sin + up * self._cos)
            here = (turned[0] + 200 - LEFT, turned[1] + 210 + self._down - TOP)
            placed.append((SCALE * here[0], SCALE * here[1]))
        return placed

    def fill(self, points: Iterable[Point], color: str) -> None:
        self._draw.polygon(self._place(points), fill=color)

    def line(self, points: Iterable[Point], px: float, color: str = INK) -> None:
        placed = self._place(points)
        self._draw.line(placed, color, round(px * SCALE), joint="curve")
        for x, y in (placed[0], placed[-1]):
            r = px * SCALE / 2
            self._draw.ellipse((x - r, y - r, x + r, y + r), fill=color)


def _ellipse(x: float, y: float, across: float, up: float) -> list[Point]:
    steps = [math.tau * step / 40 for step in range(40)]
    return [(x + across * math.cos(one), y + up * math.sin(one)) for one in steps]


def _box(x: float, y: float, wide: float, high: float, round_px: float) -> list[Point]:
    """Return a rounded box, as a superellipse does it."""
    power = 2 * round_px / min(wide, high)
    corners = []
    for step in range(80):
        c, s = math.cos(math.tau * step / 80), math.sin(math.tau * step / 80)
        across, up = (math.copysign(abs(one) ** power, one) for one in (c, s))
        corners.append((x + wide / 2 * (1 + across), y + high / 2 * (1 + up)))
    return corners


def _curve(start: Point, middle: Point, end: Point) -> list[Point]:
    points = []
    for step in range(17):
        t = step / 16
        a, b, c = (1 - t) ** 2, 2 * t * (1 - t), t * t
        pairs = zip(start, middle, end, strict=True)
        x, y = (a * p + b * q + c * r for p, q, r in pairs)
        points.append((x, y))
    return points


def draw_face(look: Look) -> Image.Image:
    """Return the picture of a look, ``WIDTH`` to ``HEIGHT``."""
    pen = _Pen(look)
    pen.fill(_box(120, 80, 160, 130, 30), HEAD)
    pen.fill(_box(134, 98, 132, 96, 24), SKIN)
    for side, x in zip((1, -1), EYES_X, strict=True):
        at = x + 7 * look.gaze
        if look.eyes == HAPPY:
            pen.line(_curve((at - 13, EYES_Y + 6), (at, EYES_Y - 18), (at + 13, EYES_Y + 6)), 6)
        else:
            low = EYES_Y + 5 * look.nod
            pen.fill(_ellipse(at, low, EYE_PX, max(EYE_PX * look.eyes, 2)), INK)
        if look.brows_deg:
            rise = 13 * math.tan(math.radians(look.brows_deg))
            y = EYES_Y - 20
            pen.line([(x - 13, y + side * rise), (x + 13, y - side * rise)], 5)
    mouth = _curve(*MOUTHS[look.mouth])
    if look.mouth == "laugh":
        pen.fill(mouth, INK)
    pen.line(mouth, 6)
    if look.hand_deg is not None:
        _draw_hand(pen, look.hand_deg)
    return pen.image


def _draw_hand(pen: _Pen, angle_deg: float) -> None:
    """Draw a waving hand beside the head: a palm, four fingers and a thumb."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))

    def at(x: float, y: float) -> Point:
        return 268 + x * c - y * s, 208 + x * s + y * c  # about its wrist

    for finger, long_px in ((-17, 64), (-6, 72), (6, 72), (17, 64)):
        pen.line([at(finger, -34), at(finger * 1.4, -long_px)], 10, HAND)
    pen.line([at(-14, -20), at(-34, -40)], 10, HAND)
    pen.fill([at(*point) for point in _ellipse(0, -24, 22, 24)], HAND)
