"""Draws the twin with its mast and the face on its screen, as a camera or a walker sees it.

Importing this needs pillow, and a renderer pybullet: the twin extra.
"""

from __future__ import annotations

import io
from importlib.resources import as_file, files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from robot.bases.twin.face import draw_face
from robot.motion.face_and_arms import REST, Look
from robot.motion.pose import Pose

# The screen on the mast (kobuki.urdf): how far ahead, half its width, its middle, half its height.
SCREEN_M = (0.0085, 0.085, 0.785, 0.06)


class View(NamedTuple):
    """Where a camera stands and what it looks at [m], its field of view [°] and picture [px]."""

    eye_m: tuple[float, float, float]
    target_m: tuple[float, float, float]
    field_deg: float
    width_px: int
    height_px: int


# The whole tether is in the picture.
ROOM = View((1.25, -1.05, 1.25), (0.0, 0.0, 0.35), 50.0, 320, 240)


class Renderer:
    """Draws the twin in a world without physics. Raises ImportError without the twin extra.

    Parameters
    ----------
    view
        What is drawn.
    """

    def __init__(self, view: View = ROOM) -> None:
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        self._world: Any = BulletClient(pybullet.DIRECT)
        self._size = view.width_px, view.height_px
        floor = self._world.createVisualShape(
            self._world.GEOM_BOX, halfExtents=(5, 5, 0.005), rgbaColor=(0.86, 0.88, 0.9, 1)
        )
        self._world.createMultiBody(baseVisualShapeIndex=floor, basePosition=(0, 0, -0.006))
        self._textures: dict[Look, int] = {}
        tiles = self._world.createVisualShape(
            self._world.GEOM_MESH,
            vertices=[(x, y, -0.0005) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
            indices=[0, 1, 2, 0, 2, 3],
            uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
            normals=[(0, 0, 1)] * 4,
        )
        mat = self._world.createMultiBody(baseVisualShapeIndex=tiles)
        self._world.changeVisualShape(mat, -1, textureUniqueId=self._load(_draw_tiles()))
        home = self._world.createVisualShape(
            self._world.GEOM_CYLINDER, radius=0.2, length=0.002, rgbaColor=(0.3, 0.62, 0.8, 1)
        )
        self._world.createMultiBody(baseVisualShapeIndex=home)
        with as_file(files("robot.bases.twin") / "kobuki.urdf") as urdf:
            self._robot = self._world.loadURDF(str(urdf))
        self._screen = self._world.createMultiBody(
            baseVisualShapeIndex=self._world.createVisualShape(
                self._world.GEOM_MESH,
                vertices=[
                    (SCREEN_M[0], side * SCREEN_M[1], SCREEN_M[2] + up * SCREEN_M[3])
                    for side, up in ((-1, -1), (1, -1), (1, 1), (-1, 1))
                ],
                indices=[0, 1, 2, 0, 2, 3],
                uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
                normals=[(1, 0, 0)] * 4,
            )
        )
        self._view = self._world.computeViewMatrix(view.eye_m, view.target_m, (0, 0, 1))
        self._lens = self._world.computeProjectionMatrixFOV(
            view.field_deg, view.width_px / view.height_px, 0.1, 10
        )

    def picture(self, pose: Pose, look: Look = REST) -> Image.Image:
        """Return a picture of the twin at a pose, with a look on its screen."""
        turned = self._world.getQuaternionFromEuler((0, 0, pose.heading_rad))
        for body in (self._robot, self._screen):
            self._world.resetBasePositionAndOrientation(body, (pose.x_m, pose.y_m, 0.0), turned)
        self._world.changeVisualShape(self._screen, -1, textureUniqueId=self._texture(look))
        width, height = self._size
        drawn = self._world.getCameraImage(
            width,
            height,
            viewMatrix=self._view,
            projectionMatrix=self._lens,
            lightDirection=(2.0, 0.5, 2.0),
            renderer=self._world.ER_TINY_RENDERER,
            flags=self._world.ER_NO_SEGMENTATION_MASK,
        )
        return Image.fromarray(np.asarray(drawn[2], np.uint8).reshape(height, width, 4))

    def draw(self, pose: Pose, look: Look = REST) -> bytes:
        """Return the same picture as PNG."""
        png = io.BytesIO()
        self.picture(pose, look).save(png, "PNG", compress_level=1)
        return png.getvalue()

    def _texture(self, look: Look) -> int:
        if look not in self._textures:
            self._textures[look] = self._load(draw_face(look))
        return self._textures[look]

    def _load(self, picture: Image.Image) -> int:
        with TemporaryDirectory() as folder:
            file = Path(folder) / "texture.png"
            picture.save(file)
            return int(self._world.loadTexture(str(file)))


def _draw_tiles() -> Image.Image:
    """Return 2 m of floor in tiles of 10 cm, against which a motion is seen."""
    tiles = Image.new("RGB", (1000, 1000), "#dbe0e6")
    pen = ImageDraw.Draw(tiles)
    for at in range(0, 1001, 50):
        pen.line([(at, 0), (at, 1000)], "#8c97a3", 3)
        pen.line([(0, at), (1000, at)], "#8c97a3", 3)
    return tiles
