"""A picture of the twin, or of what it sees, drawn by a process of its own beside it.

Drawing takes longer than one frame of the twin. So the process gets poses on standard input, and
draws only the last of those that came while it drew.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Self

from robot.bases.twin.bullet import redirect_output
from robot.motion.pose import Pose

INTERVAL_S = 0.2  # of the twin: five a second at most
SEES_EVERY_S = 1 / 12  # of what it sees: as often as cheap cameras, if the computer can
END_S = 2.0


class Camera:
    """Keeps a file with the newest picture of a twin.

    Parameters
    ----------
    file
        A PNG; always whole, since each picture takes the place of the last at once.
    get_pose
        Returns the twin's pose.
    tag
        Number of a tag in the room: then it is a picture of what a camera on the twin sees. None
        for one of the twin.
    """

    def __init__(self, file: Path, get_pose: Callable[[], Pose], tag: int | None = None) -> None:
        self._file, self._get_pose = file, get_pose
        self._tags = [] if tag is None else [tag]
        self._over = threading.Event()

    def __enter__(self) -> Self:
        """Start to draw."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(self._file), *map(str, self._tags)],
            stdin=subprocess.PIPE,
            start_new_session=True,
        )
        self._sender = threading.Thread(target=self._send_poses, daemon=True)
        self._sender.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop. The last picture stays."""
        self._over.set()
        self._sender.join(END_S)
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send_poses(self) -> None:
        pipe, every_s = self._process.stdin, SEES_EVERY_S if self._tags else INTERVAL_S
        with contextlib.suppress(OSError):  # it has ended before us
            while pipe is not None and not self._over.wait(every_s):
                pose = self._get_pose()
                line = json.dumps([pose.x_m, pose.y_m, pose.heading_rad])
                pipe.write(line.encode() + b"\n")
                pipe.flush()
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()


def main(file: Path, *tags: int) -> None:
    """Draw the twin, or what it sees of tags, at the newest pose of standard input."""
    if hasattr(os, "nice"):
        os.nice(10)  # the twin and the server come first
    redirect_output()
    draw: Callable[[Pose], bytes]
    if tags:
        from robot.bases.twin.tag_view import TagView  # needs pybullet and OpenCV

        draw = TagView(*tags).draw
    else:
        from robot.bases.twin.renderer import Renderer  # needs pybullet and pillow

        draw = Renderer().draw
    rest = b""
    new = file.with_name(f".{file.name}.new")
    while data := os.read(0, 65536):
        *lines, rest = (rest + data).split(b"\n")
        if lines:
            new.write_bytes(draw(Pose(*json.loads(lines[-1]))))
            new.replace(file)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
