"""`python -m robot tag sheet|look|learn`: home again by a tag (docs/robot.md#home-again-by-a-tag).

`sheet FILE.svg` writes a tag to print; `look` says what the camera sees; `learn` stores how the tag
is seen from home, for this base: put it on its mark first. None of them moves anything.
Exit status: 0 done; 1 the tag was not seen well, or the base does not answer; 2 the command line
cannot be used; 130 Ctrl-C.
"""

from __future__ import annotations

import math
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from robot.atomic_file import write_atomically
from robot.base_options import (
    add_base_arguments,
    make_base,
    make_command_parser,
    print_line,
    print_notice,
)
from robot.bases import BASES, BadOption, BaseLost
from robot.calibration import BadCalibration, store_home_view
from robot.homing.camera_supervisor import CameraEye
from robot.homing.codes import CAMERA_SILENT, CURES
from robot.homing.home_view import BadHomeView, Carried, HomeView, Lens, Mount, check_tag
from robot.homing.sighting import Sighting

if TYPE_CHECKING:  # it needs the extra `tag`
    from robot.homing.homing import Eye

TAG, SIZE_MM, FIELD_DEG = 7, 160.0, 60.0  # 60° are ordinary for a webcam
TICK_S = 0.02
STARTS_S = 10.0  # within which a camera sends its first frame
LEARNS_FRAMES = 40


class NotLearned(RuntimeError):
    """A home that could not be learned; the message says why."""


def learn(
    eye: Eye,
    options: Namespace,
    monotonic: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], object] = time.sleep,
) -> HomeView:
    """Return how a tag is seen now. Raises NotLearned and BadHomeView.

    Parameters
    ----------
    eye
        What looks for it.
    options
        Of the command line.
    monotonic, sleep
        The clock [s], and how to wait by it.
    """
    from robot.homing.homing import SURE_M, SURE_RAD
    from robot.homing.still_frames import Look
    from robot.homing.tag_pose import find_place, solve_tag

    first = next(watch(eye, monotonic, sleep))
    if first.problem:
        raise NotLearned(CURES.get(first.problem, first.problem))
    look = Look(options.id, first.size_px, monotonic(), LEARNS_FRAMES)
    while not look.is_whole:
        eye.watch(monotonic())
        for sighting in eye.take():
            look.add(sighting)
        if problem := look.problem(monotonic()):
            seen = f" In view: {', '.join(map(str, sorted(look.seen)))}." if look.seen else ""
            raise NotLearned(CURES.get(problem, problem) + seen)
        sleep(TICK_S)
    lens = Lens(*first.size_px, math.radians(options.field_deg))
    size_m = options.size_mm / 1000
    (x_rad, y_rad, z_rad), (x_m, y_m, z_m) = (
        values.tolist()
        for solution in solve_tag(look.corners_px, size_m, lens)[:1]
        for values in (solution.turn_rad, solution.place_m)
    )
    view = HomeView(
        options.camera,
        options.id,
        size_m,
        Carried(options.on_base),
        Mount(
            options.ahead_mm / 1000,
            options.left_mm / 1000,
            math.radians(options.turned_deg),
            math.radians(options.tilted_deg),
        ),
        lens,
        (x_rad, y_rad, z_rad),
        (x_m, y_m, z_m),
    )
    place = find_place(look.corners_px, view)
    if place is None or place.error_m > SURE_M or place.error_rad > SURE_RAD:
        how = ""
        if place is not None:
            how = f" ({1000 * place.error_m:.0f} mm, {math.degrees(place.error_rad):.1f}°)"
        raise NotLearned(
            f"From here the tag does not tell surely enough where home is{how}. Bring it within "
            "1 m of the camera, turn it 30° to 45° away from the line of sight, or print it larger."
        )
    return view


def watch(
    eye: Eye, monotonic: Callable[[], float], sleep: Callable[[float], object]
) -> Iterator[Sighting]:
    """Yield what an eye sees; where nothing comes for long, that the camera is silent."""
    heard_s = monotonic()
    while True:
        eye.watch(monotonic())
        for sighting in eye.take():
            heard_s = monotonic()
            yield sighting
        if monotonic() - heard_s > STARTS_S:
            yield Sighting(monotonic(), problem=CAMERA_SILENT)
            heard_s = monotonic()
        sleep(TICK_S)


def describe(sighting: Sighting, now_s: float, size_m: float, field_deg: float) -> Iterator[str]:
    """Yield a line for each tag in a frame, or one that says what is wrong with it."""
    import numpy as np

    from robot.homing.tag_pose import is_clear, solve_tag

    if sighting.problem:
        yield CURES.get(sighting.problem, sighting.problem)
        return
    lens = Lens(*sighting.size_px, math.radians(field_deg))
    age = f"{1000 * (now_s - sighting.at_s):.0f} ms old"
    if not sighting.tags:
        yield f"no tag; {lens.width_px} × {lens.height_px}, {age}"
    for number, corners in sighting.tags:
        solutions = solve_tag(np.array(corners), size_m, lens)
        if not solutions:
            continue
        place_m, facing = solutions[0].place_m, solutions[0].tag[:3, 2]
        x_m, _, z_m = place_m.tolist()
        away_m = float(np.linalg.norm(place_m))
        turned_deg = math.degrees(math.acos(min(1.0, abs(float(place_m @ facing)) / away_m)))
        doubt = "" if is_clear(solutions) else " (or the other way)"
        yield (
            f"tag {number}: {away_m:.3f} m, {math.degrees(math.atan2(x_m, z_m)):.1f}° "
            f"to the right, turned {turned_deg:.0f}° from the line of sight{doubt}, {age}"
        )


def fit_field_deg(sighting: Sighting, size_m: float, field_deg: float, distance_m: float) -> float:
    """Return the field of view [°] by which the first tag of a frame is so far away.

    Parameters
    ----------
    sighting
        A frame with a tag, near its middle.
    size_m
        Side of the tag's black square [m].
    field_deg
        The field of view that was assumed [°].
    distance_m
        From the lens to the middle of the tag, by a ruler [m].
    """
    import numpy as np

    from robot.homing.tag_pose import solve_tag

    lens = Lens(*sighting.size_px, math.radians(field_deg))
    place_m = solve_tag(np.array(sighting.tags[0][1]), size_m, lens)[0].place_m
    focal_px = lens.focal_px * distance_m / float(np.linalg.norm(place_m))
    return math.degrees(2 * math.atan(lens.width_px / 2 / focal_px))


def run_look(options: Namespace) -> int:
    """Print what the camera sees, a frame each second."""
    size_m, until_s = options.size_mm / 1000, time.monotonic() + options.for_s
    shown_s = -math.inf
    with CameraEye(options.camera) as eye:
        for sighting in watch(eye, time.monotonic, time.sleep):
            now_s = time.monotonic()
            if now_s > until_s:
                return 0
            if now_s - shown_s < 1.0:
                continue
            shown_s = now_s
            for line in describe(sighting, now_s, size_m, options.field_deg):
                print_line(line, sys.stdout)
            if options.distance_m is not None and sighting.tags:
                fits = fit_field_deg(sighting, size_m, options.field_deg, options.distance_m)
                print_line(f"    at {options.distance_m:g} m: --field-deg {fits:.1f}", sys.stdout)
    return 0


def run_learn(options: Namespace) -> int:
    """Store how the tag is seen now, as home of the base of the command line."""
    with make_base(options, time.monotonic) as base, CameraEye(options.camera) as eye:
        view = learn(eye, options)
        path = store_home_view(base, view)
        print_line(
            f"Home of {base.identity}: tag {view.tag}, {math.dist((0, 0, 0), view.place_m):.2f} m "
            f"from the camera. Stored in {path}.",
            sys.stdout,
        )
    return 0


def run_sheet(options: Namespace) -> int:
    """Write a tag to print."""
    from robot.homing.sheet import draw_sheet

    write_atomically(options.file, draw_sheet(options.id, options.size_mm / 1000).encode())
    print_line(f"{options.file}: print it at 100 %, and measure the line below it.", sys.stdout)
    return 0


def make_parser() -> ArgumentParser:
    """Return the command line's parser."""
    parser = make_command_parser("tag", __doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    sheet = commands.add_parser("sheet", help="write a tag to print")
    sheet.add_argument("file", type=Path, metavar="FILE.svg")
    look = commands.add_parser("look", help="say what the camera sees")
    look.add_argument("--for-s", type=float, default=30.0, metavar="S", help="how long (30)")
    look.add_argument(
        "--distance-m", type=float, metavar="M", help="of the tag, by a ruler: say --field-deg"
    )
    teach = commands.add_parser("learn", help="store how the tag is seen from home")
    able = sorted(
        name
        for name, base in BASES.items()
        if base.abilities.closed_loop and not base.abilities.simulated  # that is put back by itself
    )
    add_base_arguments(teach, able)
    teach.add_argument(
        "--on-base",
        choices=list(Carried),
        default=Carried.CAMERA.value,
        help="what the base carries: the camera (default), or the tag, at which a camera in the "
        "room looks",
    )
    for name, unit, what in (
        ("ahead", "mm", "how far ahead of the middle between the wheels that is"),
        ("left", "mm", "how far to the left of it"),
        ("turned", "deg", "which way it looks: 0 ahead, 90 to the left"),
        ("tilted", "deg", "how far it looks up; 90 for a tag that lies on the upper plate, the "
         "lower edge of its print ahead"),
    ):  # fmt: skip
        teach.add_argument(
            f"--{name}-{unit}", type=float, default=0.0, metavar=unit.upper(), help=f"{what} (0)"
        )
    for command in (look, teach):
        command.add_argument(
            "--camera",
            default="0",
            help="as OpenCV names it: 0, /dev/video2, rtsp://…; or file: and a picture (0)",
        )
        command.add_argument(
            "--field-deg",
            type=float,
            default=FIELD_DEG,
            help="how wide the camera's view is (default: 60; `look --distance-m` says it)",
        )
    for command in (sheet, look, teach):
        command.add_argument("--size-mm", type=float, default=SIZE_MM, help="of the black square")
    for command in (sheet, teach):
        command.add_argument("--id", type=int, default=TAG, help="number of the tag (default: 7)")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, and return the exit status."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    if find_spec("cv2") is None:
        parser.error("This needs OpenCV. Cure: pip install 'garry[tag]'.")
    run = {"sheet": run_sheet, "look": run_look, "learn": run_learn}[options.command]
    try:
        check_tag(getattr(options, "id", TAG), options.size_mm / 1000)
        return run(options)
    except (BaseLost, BadCalibration, NotLearned, OSError) as problem:
        print_notice(str(problem))
        return 1
    except (BadHomeView, BadOption) as problem:
        print_notice(str(problem))
        return 2
    except KeyboardInterrupt:
        return 130
