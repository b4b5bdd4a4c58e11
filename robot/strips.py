"""`python -m robot strips FOLDER`: film strips of gestures, as a walker 2 m away sees them.

Sheets of numbered strips in an order that follows from a seed, for viewers who know nothing: which
strip shows which gesture is in a key file, which they do not get. Needs the twin extra.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from robot.base_options import VirtualClock, make_command_parser, print_notice
from robot.bases.kinematic import KinematicBase
from robot.behavior.cue import QUIET, QUIET_PACE
from robot.behavior.performer import Performer
from robot.motion.dry_run import dry_run
from robot.motion.gesture import Gesture
from robot.motion.gestures import BUILT_IN
from robot.motion.limits import TICK_S
from robot.motion.looks import REST, find_act, look_at
from robot.motion.pools import IDLE, POOLS
from robot.motion.preview import ANNOUNCED_S
from robot.wire.cue_limits import VARIED

if TYPE_CHECKING:
    from PIL import Image

    from robot.bases.twin.renderer import Renderer

# What a viewer names, and the pools that it is.
CLASSES = {
    "joy": ("joy", "streak_3", "streak_5", "streak_10", "comeback"),
    "disappointment": ("disappointment",),
    "greeting": ("greeting",),
    "idle": ("idle",),
}
# A strong answer, one to a weak window, and one in a quiet room: share of the size, and pace.
LEVELS = {"full": (1.0, 1.0), "least": (0.5, 1.0), "gentle": (QUIET, QUIET_PACE)}
FRAMES, ROWS, LABEL_PX = 5, 4, 26
MINUTES, ACROSS = 10, 8  # of a session, and answers in a row of its sheet


class Strip(NamedTuple):
    """A gesture as it is shown: at a level, with or without its face."""

    gesture: Gesture
    kind: str
    level: str
    has_face: bool = True


def strips(level: str, *, has_face: bool) -> list[Strip]:
    """Return a strip of each variant that a viewer may name, at one of ``LEVELS``."""
    pools = POOLS | {"idle": IDLE}
    return [
        Strip(gesture, kind, level, has_face)
        for kind, names in CLASSES.items()
        for name in names
        for gesture in pools[name]
    ]


def film(strip: Strip, renderer: Renderer, frames: int = FRAMES) -> Iterator[Image.Image]:
    """Yield pictures of a gesture, spread evenly over the time that it takes."""
    share, pace = LEVELS[strip.level]
    gesture = strip.gesture
    played = dry_run(gesture.scaled(max(share, gesture.least)), pace=pace)
    took_s = ANNOUNCED_S + played.took_s
    _, script = find_act(gesture.name, is_glad=gesture.score.mood == "glad")
    for number in range(frames):
        at_s = took_s * (number + 0.5) / frames
        tick = max(round((at_s - ANNOUNCED_S) / TICK_S), 0)
        look = look_at(script, at_s) if strip.has_face else REST
        yield renderer.picture(played.poses[min(tick, len(played.poses) - 1)], look)


def make_sheets(
    folder: Path, name: str, shown: Sequence[Strip], renderer: Renderer
) -> list[dict[str, Any]]:
    """Write sheets of strips in this order, numbered from 1, and return their key."""
    from PIL import Image, ImageDraw

    key, sheet = [], Image.new("RGB", (1, 1))
    for number, strip in enumerate(shown, start=1):
        row = (number - 1) % ROWS
        pictures = list(film(strip, renderer))
        wide, high = pictures[0].width, pictures[0].height + LABEL_PX
        if row == 0:
            rows = min(ROWS, len(shown) - number + 1)
            sheet = Image.new("RGB", (FRAMES * wide, rows * high), "white")
        ImageDraw.Draw(sheet).text((6, row * high + 4), f"No. {number}", "black", font_size=18)
        for column, picture in enumerate(pictures):
            sheet.paste(picture, (column * wide, row * high + LABEL_PX))
        file = f"{name}-{(number - 1) // ROWS + 1:02}.png"
        sheet.save(folder / file)
        key.append(
            {"set": name, "file": file, "number": number, "class": strip.kind}
            | {"gesture": strip.gesture.name, "level": strip.level, "face": strip.has_face}
        )
    return key


def answers_of_a_session(above: str, below: str, seed: int) -> list[Gesture]:
    """Return what answers ten minutes of good and weak walking, by a cue and its seed."""
    clock = VirtualClock()
    performer = Performer(KinematicBase(clock.monotonic))
    cue = {"above": above, "below": below, "threshold": 0.9, "window_s": 5, "rest_s": 5}
    welcome = {"type": "welcome", "session": seed, "state": "running", "watched": True}
    performer.handle(welcome | {"cue": cue | {"intensity": 1, "seed": seed}}, 0.0)
    chance, seen = random.Random(seed), list[Gesture]()  # noqa: S311 (no secret)
    for second in range(60 * MINUTES):
        performance = chance.gauss(1.0 if second // 40 % 3 < 2 else 0.8, 0.12)
        step = {"type": "step", "time_s": second, "performance": performance}
        performer.handle(step, clock.now_s)
        for _ in range(round(1 / TICK_S)):
            clock.sleep(TICK_S)
            performer.handle({"type": "heartbeat"}, clock.now_s)
            performer.tick(clock.now_s)
        while performer.reports:
            report = performer.reports.popleft()
            if report["kind"] == "decision" and report["gesture"]:
                seen.append(BUILT_IN[report["gesture"]])
    return seen


def make_session_sheet(file: Path, answers: Sequence[Gesture], renderer: Renderer) -> None:
    """Write a sheet of a session's answers in their order, each as its middle moment twice."""
    from PIL import Image

    cells = []
    for gesture in answers:
        strip = Strip(gesture, "", "full")
        cells.append(list(film(strip, renderer, 3))[:2])
    wide, high = 2 * 90 + 6, 152
    rows = -(-len(cells) // ACROSS)
    sheet = Image.new("RGB", (ACROSS * wide, rows * high), "white")
    for number, pictures in enumerate(cells):
        for half, picture in enumerate(pictures):
            at = (number % ACROSS * wide + half * 90, number // ACROSS * high)
            sheet.paste(picture.resize((90, 146)), at)
    sheet.save(file)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the sheets and the key of the command line, and return the exit status."""
    parser = make_command_parser("strips", __doc__)
    parser.add_argument("folder", type=Path, help="where the sheets go; made where it is missing")
    parser.add_argument("--key", type=Path, required=True, help="which strip is which (JSON)")
    parser.add_argument("--seed", type=int, default=36, help="of the order (default: 36)")
    parser.add_argument("--no-face", action="store_true", help="the motion alone: a still face")
    options = parser.parse_args(arguments)
    if not (find_spec("pybullet") and find_spec("PIL")):
        print_notice("Strips need pybullet and pillow. Cure: pip install 'garry[twin]'.")
        return 2
    from robot.bases.twin.renderer import WALKER, Renderer

    options.folder.mkdir(parents=True, exist_ok=True)
    renderer, key = Renderer(WALKER), list[dict[str, Any]]()
    for name, level in zip("ABC", LEVELS, strict=True):
        shown = strips(level, has_face=not options.no_face)
        random.Random(f"{options.seed} {name}").shuffle(shown)  # noqa: S311 (no secret)
        key += make_sheets(options.folder, name, shown, renderer)
    sessions = [("celebrate", "droop"), (VARIED, VARIED)]
    random.Random(options.seed).shuffle(sessions)  # noqa: S311
    for name, (above, below) in zip("XY", sessions, strict=True):
        answers = answers_of_a_session(above, below, options.seed)
        make_session_sheet(options.folder / f"session-{name}.png", answers, renderer)
        seen = [gesture.name for gesture in answers]
        key.append({"set": f"session {name}", "above": above, "below": below, "answers": seen})
    options.key.write_text(json.dumps({"seed": options.seed, "strips": key}, indent=1) + "\n")
    return 0
