"""An SVG drawing of a gesture's simulated path, seen from above; ahead is up."""

from __future__ import annotations

import math
from collections.abc import Sequence

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

from robot.motion.dry_run import DryRun
from robot.motion.gesture import TETHER_M
from robot.motion.gesture_spec import Move, step_poses
from robot.motion.pose import Pose

BASE_M = 0.175  # radius of a Kobuki
HEADING_M = 0.05  # length of the line that shows the heading
LABEL_M = 0.02  # from the line's end to its number, on its right
SIDE = 340  # px

# Presentation attributes: the content security policy allows no styles.
DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="-0.34 -0.34 0.68 0.68" width="{side}"
 height="{side}" role="img" aria-label="{words}" fill="none" stroke="currentColor">
<circle r="{tether}" stroke-width=".003" stroke-dasharray=".012 .01" opacity=".6"/>
<circle r="{base}" fill="currentColor" stroke="none" opacity=".09"/>
<path d="M0 -.335v.03M-.01 -.325l.01 -.01l.01 .01" stroke-width=".004" opacity=".6"/>
{headings}<path d="{path}" stroke="var(--link-fg)" stroke-width=".009"/></svg>"""
HEADING = (
    '<path d="M{} {}L{} {}" stroke-width=".004"/>'
    '<text x="{}" y="{}" font-size=".026" text-anchor="middle" dominant-baseline="central"'
    ' fill="currentColor" stroke="none">{}</text>'
)


def draw_path(moves: Sequence[Move], dry_run: DryRun, words: str) -> SafeString:
    """Return an SVG of a gesture's path, with the base's heading at the end of each step.

    ``words`` describe it to screen readers.
    """
    headings: dict[tuple[float, float, int], list[str]] = {}
    for number, pose in enumerate(step_poses(moves), start=1):
        degrees = round(math.degrees(pose.heading_rad)) % 360
        at = (round(pose.x_m, 3), round(pose.y_m, 3), degrees)
        headings.setdefault(at, []).append(str(number))
    return format_html(
        DRAWING,
        side=SIDE,
        words=words,
        tether=TETHER_M,
        base=BASE_M,
        path="M" + "L".join(_point(pose) for pose in dry_run.poses[::2]),
        headings=format_html_join(
            "", HEADING, (_heading(at, numbers) for at, numbers in headings.items())
        ),
    )


def _point(pose: Pose) -> str:
    return f"{-pose.y_m:.4f} {-pose.x_m:.4f}"


def _heading(at: tuple[float, float, int], numbers: list[str]) -> tuple[str, ...]:
    x_m, y_m, degrees = at
    ahead_x, ahead_y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    tip = (-(y_m + HEADING_M * ahead_y), -(x_m + HEADING_M * ahead_x))
    label = (tip[0] + LABEL_M * ahead_x, tip[1] - LABEL_M * ahead_y)
    coordinates = (-y_m, -x_m, *tip, *label)
    return (*(f"{number:.4f}" for number in coordinates), ", ".join(numbers))
