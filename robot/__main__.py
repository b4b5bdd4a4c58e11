"""`python -m robot --base NAME …`: lets a base perform for the sessions of its station.

`python -m robot gesture NAME --base NAME` plays one gesture, without a server;
`python -m robot calibrate --base NAME` measures how a base answers, once for each;
`python -m robot doctor` finds a Kobuki's port and says what is wrong on the way to it;
`python -m robot replay FILE --base NAME` gives a simulated base the orders of an incident again;
`python -m robot tag` prints a tag, and learns how it is seen from home;
`python -m robot twin` is a simulated one at a port of its own.

Exit status: 0 ended by SIGTERM or SIGHUP (--child: standard input closed); 1 the base does not
answer any more; 2 the command line cannot be used; 3 the server refuses this robot; 130 stopped by
Ctrl-C.
However it ends, the base stands still.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import threading
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from robot import calibrate, doctor, play_gesture, replay, tag
from robot.base_options import (
    add_base_arguments,
    make_base,
    make_command_parser,
    print_notice,
)
from robot.bases import BadOption, BaseLost, MobileBase
from robot.bases.twin.__main__ import main as run_twin
from robot.black_box.recorder import BlackBox
from robot.calibration import (
    BadCalibration,
    apply_calibration,
    calibration_file,
    find_home_view,
    home_file,
)
from robot.connection_args import (
    BadConnectionArgs,
    add_connection_arguments,
    find_token,
    find_token_store,
    websocket_url,
)
from robot.homing.camera_supervisor import CameraEye
from robot.link import Link, LinkRefused
from robot.original_connection import OriginalTopics
from robot.ros.holder import add_driven_base_arguments, find_driven_base
from robot.ros.original_nodes import TOPICS
from robot.worker import Worker

if TYPE_CHECKING:  # it needs the extra `tag`
    from robot.homing.homing import Homing

ROBOT_PATH = "/ws/robot/"

BLACK_BOX = "~/.local/state/garry/black_box"

# What follows `python -m robot`: its own arguments are those behind it.
COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {
    "calibrate": calibrate.main,
    "doctor": doctor.main,
    "gesture": play_gesture.main,
    "replay": replay.main,
    "tag": tag.main,
    "twin": run_twin,
}
DONE, LOST, UNUSABLE, REFUSED, INTERRUPTED = 0, 1, 2, 3, 130


def make_parser() -> ArgumentParser:
    """Return the command line's parser."""
    parser = make_command_parser("", __doc__)
    parser.epilog = "The token may also be in the environment, as GARRY_ROBOT_TOKEN."
    add_base_arguments(parser)
    parser.add_argument(
        "--original-topics",
        nargs="*",
        choices=sorted(TOPICS),
        help="publish on these of the original's topics at the rosbridge, beside any base "
        "(without a name: on all)",
    )
    add_driven_base_arguments(parser)
    parser.add_argument(
        "--black-box",
        default=os.environ.get("GARRY_ROBOT_BLACK_BOX", BLACK_BOX),
        metavar="FOLDER",
        help="where to record the last minutes, and retain those around a stop; off for nowhere "
        "(default: GARRY_ROBOT_BLACK_BOX, or ~/.local/state/garry/black_box)",
    )
    add_connection_arguments(parser)
    return parser


def find_black_box(named: str, own: str) -> Path | None:
    """Return a robot's own folder in that of the option; None where it is off.

    Parameters
    ----------
    named
        The option: a folder, or off.
    own
        What identifies this robot from run to run: its token's file, or the token.
    """
    if named in ("", "off"):
        return None
    return Path(named).expanduser() / sha256(own.encode()).hexdigest()[:12]


def open_homing(base: MobileBase, opened: contextlib.ExitStack) -> Homing | None:
    """Return what drives an open base home by its tag; None where it has not learned one.

    Its camera's process is ended with ``opened``. Raises BadCalibration.
    """
    view = find_home_view(base)
    if view is None or not base.abilities.closed_loop:
        return None
    if find_spec("cv2") is None:
        print_notice(
            f"{home_file()} says how {base.identity} sees home, and OpenCV is not installed: it "
            "does not drive home by itself. Cure: pip install 'garry[tag]'."
        )
        return None
    from robot.homing.homing import Homing

    eye = opened.enter_context(CameraEye(view.camera))
    print_notice(f"It finds home by tag {view.tag}, camera {view.camera}.")
    return Homing(view, eye, base.response)


async def wait_for_end(is_child: bool) -> None:
    """Wait for SIGTERM, SIGHUP, and for the end of standard input where a server supervises us."""
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    for name in ("SIGTERM", "SIGHUP"):
        with contextlib.suppress(
            NotImplementedError, AttributeError
        ):  # Windows has no such signals
            loop.add_signal_handler(getattr(signal, name), ended.set)

    def read_to_the_end() -> None:
        with contextlib.suppress(OSError):
            while os.read(0, 1024):
                pass
        with contextlib.suppress(RuntimeError):  # the loop has ended before
            loop.call_soon_threadsafe(ended.set)

    if is_child:
        threading.Thread(target=read_to_the_end, daemon=True).start()
    await ended.wait()


async def run_worker(make_worker: Callable[[], Worker], is_child: bool) -> None:
    """Run a worker until the process is to end. Raises LinkRefused and BaseLost.

    Parameters
    ----------
    make_worker
        Makes the worker, on the loop that it runs on.
    is_child
        Whether the end of standard input ends it.
    """
    worker = make_worker()
    tasks = [asyncio.create_task(worker.run()), asyncio.create_task(wait_for_end(is_child))]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def run(options: Namespace) -> int:
    """Run a robot to its end, and return the exit status.

    Raises BadConnectionArgs, BadCalibration and BadOption.
    """
    url = websocket_url(options.server, ROBOT_PATH)
    token = find_token(options, "GARRY_ROBOT_TOKEN", "a robot")
    if options.child:  # Ctrl-C reaches server and robot; the server decides when to end
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    base, originals = make_base(options, time.monotonic), None
    if options.original_topics is not None:
        names = options.original_topics or TOPICS
        originals = OriginalTopics(options.ros_url, names, find_driven_base(options))
    # By what stays the same: the token of a file is replaced now and then.
    own = token if options.token_file is None else str(options.token_file.resolve())
    folder = find_black_box(options.black_box, own)
    keeps_motion = find_spec("mcap") is not None
    box = None if folder is None else BlackBox(folder, keeps_motion=keeps_motion)
    with (
        base,
        originals or contextlib.nullcontext(),
        box or contextlib.nullcontext(),
        contextlib.ExitStack() as opened,
    ):
        if apply_calibration(base):
            print_notice(f"{base.identity} answers as it was measured to.")
        elif base.abilities.moves and not base.abilities.simulated:
            print_notice(
                f"{calibration_file()} has no measurement of {base.identity}. Run `python -m robot "
                f"calibrate` for that file."
            )
        homing = open_homing(base, opened)
        make_worker = partial(
            Worker,
            partial(Link, url, token, store_token=find_token_store(options, print_notice)),
            base,
            originals=originals,
            black_box=box,
            homing=homing,
            notice=print_notice,
        )
        try:
            asyncio.run(run_worker(make_worker, options.child))
        except KeyboardInterrupt:
            print_notice("Stopped.")
            return INTERRUPTED
        except LinkRefused as refusal:
            print_notice(f"{refusal}")
            return REFUSED
        except BaseLost as problem:
            print_notice(f"{problem}")
            return LOST
    return DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command of the command line, and return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words and words[0] in COMMANDS:
        return COMMANDS[words[0]](words[1:])
    options = make_parser().parse_args(words)
    try:
        return run(options)
    except (BadCalibration, BadConnectionArgs, BadOption) as problem:
        print_notice(f"{problem}")
        return UNUSABLE
    except KeyboardInterrupt:
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
