"""A character on any browser's screen that answers where there is no robot."""

from robot.bases.avatar.base import AvatarBase

__all__ = ["AvatarBase"]
