"""Film strips of gestures, as a walker sees them from 2 m, for viewers who know nothing.

`python -m tests.bench.strips FOLDER --key KEY.json`: one picture for each strip, under a code name
that says nothing, and a sheet of ten minutes of varied and of fixed answers. Which strip shows
which gesture is in the key file, which viewers do not get. Everything follows from the seed.
"""

from __future__ import annotations

import json
import random
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image, ImageDraw

from robot.bases.twin.renderer import Renderer, View
from robot.motion.dry_run import dry_run
from robot.motion.face_and_arms import REST, find_act, look_at
from robot.motion.gesture import Gesture
from robot.motion.gesture_variants import IDLE, POOLS
from robot.motion.gestures import BUILT_IN
from robot.motion.limits import TICK_S
from robot.motion.preview import ANNOUNCED_S
from robot.wire.cue_limits import VARIED
from tests.support.robot_stage import walk_ten_minutes
from tests.support.variants import at_level, levels_of

# What a viewer names, and the pools that it is.
CLASSES = {
    "joy": ("joy", "streak_3", "streak_5", "streak_10", "comeback"),
    "disappointment": ("disappointment",),
    "greeting": ("greeting",),
    "idle": ("idle",),
}
FRAMES, EVERY_S, ACROSS, LABEL_PX = 16, 0.3, 4, 22  # as far apart in each strip: speed is seen
# What somebody sees who walks 2 m in front of it, with eyes at 1.55 m; its base alone.
WALKER = View((2.0, 0.0, 1.55), (0.0, 0.0, 0.335), 28.0, 210, 340)
BASE = View((2.0, 0.0, 1.55), (0.06, 0.0, 0.08), 15.0, 360, 270)
SESSION_ACROSS = 8  # answers in a row of a session's sheet


class Strip(NamedTuple):
    """A gesture as it is shown: at a level, with or without its face."""

    gesture: Gesture
    kind: str
    level: str
    has_face: bool = True


def choose(seed: int, *, each: int | None, has_face: bool) -> list[Strip]:
    """Return strips in a random order.

    Parameters
    ----------
    seed
        Of the choice and the order.
    each
        How many strips of each class, no gesture at a level twice; None for all variants at all
        levels.
    has_face
        Whether the screen on the mast acts.
    """
    chance, pools, chosen = random.Random(seed), POOLS | {"idle": IDLE}, list[Strip]()
    for kind, names in CLASSES.items():
        shown = [
            Strip(gesture, kind, level, has_face)
            for name in names
            for gesture in pools[name]
            for level in levels_of(gesture.name)
        ]
        chosen += shown if each is None else chance.sample(shown, min(each, len(shown)))
    chance.shuffle(chosen)
    return chosen


def film(strip: Strip, renderer: Renderer, frames: int) -> list[tuple[float, Image.Image]]:
    """Return pictures of a gesture from its first motion on, and when each was taken [s]."""
    gesture, pace = at_level(strip.gesture, strip.level)
    if strip.gesture in IDLE:  # never scaled
        gesture = strip.gesture
    played = dry_run(gesture, pace=pace)
    _, script = find_act(gesture.name, is_glad=gesture.score.mood == "glad")
    taken = []
    for number in range(frames):
        at_s = EVERY_S * number
        look = look_at(script, ANNOUNCED_S + at_s) if strip.has_face else REST
        pose = played.poses[min(round(at_s / TICK_S), len(played.poses) - 1)]
        taken.append((at_s, renderer.picture(pose, look)))
    return taken


def draw(strip: Strip, renderer: Renderer) -> Image.Image:
    """Return a strip: its frames in rows, the time under each."""
    taken = film(strip, renderer, FRAMES)
    wide, high = taken[0][1].width + 4, taken[0][1].height + LABEL_PX
    sheet = Image.new("RGB", (ACROSS * wide, FRAMES // ACROSS * high), "white")
    pen = ImageDraw.Draw(sheet)
    for number, (at_s, picture) in enumerate(taken):
        x, y = number % ACROSS * wide, number // ACROSS * high
        sheet.paste(picture, (x, y))
        pen.text((x + wide / 2, y + high - 2), f"{at_s:.1f} s", "black", anchor="ms", font_size=16)
    return sheet


def draw_session(answers: Sequence[str], renderer: Renderer) -> Image.Image:
    """Return a session's answers in their order, each at its beginning and at its farthest."""
    rows, wide, high = -(-len(answers) // SESSION_ACROSS), 2 * 90 + 6, 152
    sheet = Image.new("RGB", (SESSION_ACROSS * wide, rows * high), "white")
    for number, name in enumerate(answers):
        x, y = number % SESSION_ACROSS * wide, number // SESSION_ACROSS * high
        for half, (_, picture) in enumerate(
            film(Strip(BUILT_IN[name], "", "full"), renderer, 5)[2:5:2]
        ):
            sheet.paste(picture.resize((90, 146)), (x + half * 90, y))
    return sheet


def main(arguments: Sequence[str]) -> None:
    """Write the strips, the sessions' sheets and the key of the command line."""
    parser = ArgumentParser("tests.bench.strips", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the pictures go; made where it is missing")
    parser.add_argument("--key", type=Path, required=True, help="which strip is which (JSON)")
    parser.add_argument("--seed", type=int, default=36, help="of names and order (default: 36)")
    parser.add_argument("--each", type=int, help="strips of each class (default: all variants)")
    parser.add_argument("--no-face", action="store_true", help="the base alone, below its mast")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    renderer = Renderer(BASE if options.no_face else WALKER)
    key = list[dict[str, Any]]()
    chosen = choose(options.seed, each=options.each, has_face=not options.no_face)
    codes = random.Random(f"{options.seed} codes").sample(range(100, 1000), len(chosen))
    for code, strip in zip(codes, chosen, strict=True):
        draw(strip, renderer).save(options.folder / f"strip-{code}.png")
        key.append(
            {"strip": code, "class": strip.kind, "gesture": strip.gesture.name}
            | {"level": strip.level, "face": strip.has_face}
        )
    sessions = [("celebrate", "droop"), (VARIED, VARIED)]
    random.Random(options.seed).shuffle(sessions)
    for name, (above, below) in zip("XY", sessions, strict=True):
        stage = walk_ten_minutes(options.seed, above=above, below=below)
        seen = [one["gesture"] for one in stage.of("decision") if one["gesture"]]
        draw_session(seen, Renderer(WALKER)).save(options.folder / f"session-{name}.png")
        key.append({"session": name, "above": above, "below": below, "answers": seen})
    options.key.write_text(json.dumps({"seed": options.seed, "strips": key}, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
