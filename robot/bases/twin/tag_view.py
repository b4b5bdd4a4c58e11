"""What a camera on the twin sees of a room with a tag: for trying its way home.

Importing this needs OpenCV, and a view pybullet: the extras `tag` and `twin`.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from robot.homing.detector import MODULES, Picture, tag_modules
from robot.homing.home_view import Lens, Mount
from robot.motion.pose import Pose

LENS = Lens(640, 480, math.radians(62.0))
MOUNT, HEIGHT_M = Mount(0.1), 0.25
SIZE_M = 0.16
# Where the tag hangs, as docs/robot.md asks for: its middle [m], and which way its face looks.
PLACE_M, FACES_RAD = (0.95, 0.25, 0.27), math.radians(-135.0)
FINER = 2  # drawn so much finer, and averaged: pybullet has no smooth edges
PIXELS = 24  # of the texture, for each module
GRAY = 96, 190  # of black and white in a room's light


class TagView:
    """A camera on a base that looks ahead. Raises ImportError without pybullet.

    Parameters
    ----------
    tag
        Number of the tag in the room.
    size_m
        Side of its black square [m].
    """

    def __init__(self, tag: int, size_m: float = SIZE_M) -> None:
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        self._world: Any = BulletClient(pybullet.DIRECT)
        for half_m, middle_m, gray in (
            ((4, 4, 0.005), (0, 0, -0.006), 0.6),  # the floor
            ((0.05, 1.2, 0.2), (1.9, 0, 0.1), 0.25),  # the treadmill
            ((0.05, 4, 1.5), (3.2, 0, 1.5), 0.8),  # walls
            ((4, 0.05, 1.5), (0, -2.6, 1.5), 0.7),
        ):
            box = self._world.createVisualShape(
                self._world.GEOM_BOX, halfExtents=half_m, rgbaColor=(gray, gray, gray, 1)
            )
            self._world.createMultiBody(baseVisualShapeIndex=box, basePosition=middle_m)
        self._hang(tag, size_m)
        up_down_rad = 2 * math.atan(LENS.height_px / 2 / LENS.focal_px)
        self._lens = self._world.computeProjectionMatrixFOV(
            math.degrees(up_down_rad), LENS.width_px / LENS.height_px, 0.05, 10
        )

    def picture(self, pose: Pose) -> Picture:
        """Return what the camera sees from a pose of its base, in gray."""
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        eye = (pose.x_m + MOUNT.ahead_m * cos, pose.y_m + MOUNT.ahead_m * sin, HEIGHT_M)
        view = self._world.computeViewMatrix(eye, (eye[0] + cos, eye[1] + sin, HEIGHT_M), (0, 0, 1))
        width, height = FINER * LENS.width_px, FINER * LENS.height_px
        drawn = self._world.getCameraImage(
            width,
            height,
            viewMatrix=view,
            projectionMatrix=self._lens,
            lightDirection=(-2.0, -1.0, 3.0),
            renderer=self._world.ER_TINY_RENDERER,
            flags=self._world.ER_NO_SEGMENTATION_MASK,
        )
        fine = np.asarray(drawn[2], np.uint8).reshape(height, width, 4)[:, :, 1]
        size = LENS.width_px, LENS.height_px
        return np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.uint8)

    def draw(self, pose: Pose) -> bytes:
        """Return the same picture as PNG."""
        return bytes(cv2.imencode(".png", self.picture(pose))[1])

    def _hang(self, tag: int, size_m: float) -> None:
        """Hang the tag with a white edge of a module."""
        half = size_m / 2 * (MODULES + 2) / MODULES
        (x, y, z), across = PLACE_M, (math.sin(FACES_RAD), -math.cos(FACES_RAD))
        corners = [  # as printed: bottom left, bottom right, top right, top left
            (x - side * half * across[0], y - side * half * across[1], z + up * half)
            for side, up in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        sheet = self._world.createVisualShape(
            self._world.GEOM_MESH,
            vertices=corners,
            indices=[0, 1, 2, 0, 2, 3],
            uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
            normals=[(math.cos(FACES_RAD), math.sin(FACES_RAD), 0)] * 4,
        )
        body = self._world.createMultiBody(baseVisualShapeIndex=sheet)
        with TemporaryDirectory() as folder:
            file = Path(folder) / "tag.png"
            cv2.imwrite(str(file), _texture(tag))
            texture = self._world.loadTexture(str(file))
        self._world.changeVisualShape(body, -1, textureUniqueId=texture)


def _texture(tag: int) -> npt.NDArray[np.uint8]:
    black, white = GRAY
    modules = np.pad(np.where(tag_modules(tag), black, white), 1, constant_values=white)
    return np.asarray(np.kron(modules, np.ones((PIXELS, PIXELS))), np.uint8)
