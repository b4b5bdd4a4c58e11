"""A face on a page: the avatar's, or that of a screen on a base's mast."""

from robot.bases.face.screen import FaceScreen, read_face

__all__ = ["FaceScreen", "read_face"]
