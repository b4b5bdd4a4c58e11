"""A picture of the twin, five a second at most, drawn by a process of its own beside it.

Drawing takes longer than one frame of the twin. So the process gets poses on standard input, and
draws only the last of those that came while it drew.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Self

import numpy as np

from robot.bases.twin.bullet import redirect_output
from robot.motion.pose import Pose

INTERVAL_S = 0.2
WIDTH, HEIGHT = 320, 240  # 33 ms a picture on a core of 2026; 480 × 360 takes 78
END_S = 2.0
# Where the camera stands: the whole tether is in the picture.
DISTANCE_M, YAW_DEG, PITCH_DEG, FIELD_OF_VIEW_DEG = 1.6, 50.0, -35.0, 50.0


class Camera:
    """Keeps a file with the newest picture of a twin.

    Parameters
    ----------
    file
        A PNG; always whole, since each picture takes the place of the last at once.
    get_pose
        Returns the twin's pose.
    """

    def __init__(self, file: Path, get_pose: Callable[[], Pose]) -> None:
        self._file, self._get_pose = file, get_pose
        self._over = threading.Event()

    def __enter__(self) -> Self:
        """Start to draw."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(self._file)],
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
        pipe = self._process.stdin
        with contextlib.suppress(OSError):  # it has ended before us
            while pipe is not None and not self._over.wait(INTERVAL_S):
                pose = self._get_pose()
                line = json.dumps([pose.x_m, pose.y_m, pose.heading_rad])
                pipe.write(line.encode() + b"\n")
                pipe.flush()
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()


class Renderer:
    """Draws the twin in a world without physics. Raises ImportError without the twin extra."""

    def __init__(self) -> None:
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        self._world: Any = BulletClient(pybullet.DIRECT)
        floor = self._world.createVisualShape(
            self._world.GEOM_BOX, halfExtents=(5, 5, 0.005), rgbaColor=(0.86, 0.88, 0.9, 1)
        )
        self._world.createMultiBody(baseVisualShapeIndex=floor, basePosition=(0, 0, -0.006))
        home = self._world.createVisualShape(
            self._world.GEOM_CYLINDER, radius=0.2, length=0.002, rgbaColor=(0.3, 0.62, 0.8, 1)
        )
        self._world.createMultiBody(baseVisualShapeIndex=home)
        with as_file(files("robot.bases.twin") / "kobuki.urdf") as urdf:
            self._robot = self._world.loadURDF(str(urdf))
        self._view = self._world.computeViewMatrixFromYawPitchRoll(
            (0, 0, 0.05), DISTANCE_M, YAW_DEG, PITCH_DEG, 0, 2
        )
        self._lens = self._world.computeProjectionMatrixFOV(
            FIELD_OF_VIEW_DEG, WIDTH / HEIGHT, 0.1, 10
        )

    def draw(self, pose: Pose) -> bytes:
        """Return a picture of the twin at a pose, as PNG."""
        turned = self._world.getQuaternionFromEuler((0, 0, pose.heading_rad))
        self._world.resetBasePositionAndOrientation(self._robot, (pose.x_m, pose.y_m, 0.0), turned)
        picture = self._world.getCameraImage(
            WIDTH,
            HEIGHT,
            viewMatrix=self._view,
            projectionMatrix=self._lens,
            renderer=self._world.ER_TINY_RENDERER,
            flags=self._world.ER_NO_SEGMENTATION_MASK,
        )
        from PIL import Image

        rgba = np.asarray(picture[2], np.uint8).reshape(HEIGHT, WIDTH, 4)
        png = io.BytesIO()
        Image.fromarray(rgba).save(png, "PNG", compress_level=1)
        return png.getvalue()


def main(file: Path) -> None:
    """Draw the twin at the newest pose of standard input, until that closes."""
    if hasattr(os, "nice"):
        os.nice(10)  # the twin and the server come first
    redirect_output()
    renderer, rest = Renderer(), b""
    new = file.with_name(f".{file.name}.new")
    while data := os.read(0, 65536):
        *lines, rest = (rest + data).split(b"\n")
        if lines:
            new.write_bytes(renderer.draw(Pose(*json.loads(lines[-1]))))
            new.replace(file)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
