"""How its tag is seen while a base is at home: what is learned there once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Self

FAMILY = "tag36h11"
TAGS = 587  # numbers of the family, from 0

# A tag of 0.5 m fills a sheet of A2; one of 2 cm is not seen from where it helps. (Ours.)
SIZE_M = (0.02, 0.5)
FIELD_DEG = (20.0, 150.0)  # of a camera without a fish-eye lens


class BadHomeView(ValueError):
    """What cannot be how a tag is seen from home; the message says the cure."""


def check_tag(tag: int, size_m: float) -> None:
    """Check the number of a tag, and the side of its black square [m]. Raises BadHomeView."""
    if not 0 <= tag < TAGS:
        raise BadHomeView(f"A tag of {FAMILY} has a number from 0 to {TAGS - 1}.")
    least, most = SIZE_M
    if not least <= size_m <= most:
        raise BadHomeView(
            f"The side of a tag's black square is {1000 * least:g} to {1000 * most:g} mm long."
        )


class Carried(StrEnum):
    """What the base carries: the camera that looks at a tag in the room, or the tag."""

    CAMERA = "camera"
    TAG = "tag"


@dataclass(frozen=True, slots=True)
class Mount:
    """Where on the base the camera or tag is. Its height does not matter; it is not tipped aside.

    Parameters
    ----------
    ahead_m, left_m
        From the middle between the wheels [m].
    turned_rad
        Which way it looks: 0 ahead, counter-clockwise [rad].
    tilted_rad
        How far it looks up [rad]. A tag that lies on the upper plate looks up by π/2, with the
        lower edge of its print ahead.
    """

    ahead_m: float = 0.0
    left_m: float = 0.0
    turned_rad: float = 0.0
    tilted_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (abs(self.ahead_m) <= 1 and abs(self.left_m) <= 1):
            raise BadHomeView("Camera or tag is on the base: within 1 m of its middle.")
        if not (abs(self.turned_rad) <= math.pi and abs(self.tilted_rad) <= math.pi / 2):
            raise BadHomeView("It is turned by at most 180° and tilted by at most 90°.")


@dataclass(frozen=True, slots=True)
class Lens:
    """How a camera without distortion shows the room.

    Parameters
    ----------
    width_px, height_px
        Size of its frames [px].
    field_rad
        How wide its view is, from the left edge to the right one [rad].
    """

    width_px: int
    height_px: int
    field_rad: float

    def __post_init__(self) -> None:
        least, most = FIELD_DEG
        if not least <= math.degrees(self.field_rad) <= most:
            raise BadHomeView(f"A field of view lies between {least:g}° and {most:g}°.")
        if min(self.width_px, self.height_px) < 1:
            raise BadHomeView("A frame has a width and a height.")

    @property
    def focal_px(self) -> float:
        """The focal length [px]; pixels are square."""
        return self.width_px / 2 / math.tan(self.field_rad / 2)


@dataclass(frozen=True, slots=True)
class HomeView:
    """How a base's tag is seen while it stands at home.

    Parameters
    ----------
    camera
        Where the camera is, as OpenCV names it: a number, a device, an address; or ``file:`` and a
        picture that is replaced.
    tag
        Its number in the family.
    size_m
        Side of its black square [m].
    carried
        What the base carries, the camera or the tag.
    mount
        Where it carries that.
    lens
        Of the camera.
    turn_rad, place_m
        Pose of the tag in the camera's frame from home: a rotation vector [rad], and a place [m]:
        x right, y down, z ahead, as in OpenCV.
    """

    camera: str
    tag: int
    size_m: float
    carried: Carried
    mount: Mount
    lens: Lens
    turn_rad: tuple[float, float, float]
    place_m: tuple[float, float, float]

    def __post_init__(self) -> None:
        check_tag(self.tag, self.size_m)
        if not all(map(math.isfinite, (*self.turn_rad, *self.place_m))) or self.place_m[2] <= 0:
            raise BadHomeView("The tag is in front of the camera.")

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        return {"family": FAMILY} | asdict(self)

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> Self:
        """Return what ``to_json`` returned. Raises BadHomeView."""
        try:
            fields = dict(stored)
            if fields.pop("family") != FAMILY:
                raise BadHomeView(f"Its tag is not of the family {FAMILY}.")
            fields["carried"] = Carried(fields["carried"])
            fields["mount"], fields["lens"] = Mount(**fields["mount"]), Lens(**fields["lens"])
            for name in ("turn_rad", "place_m"):
                x, y, z = map(float, fields[name])
                fields[name] = (x, y, z)
            return cls(**fields)
        except (KeyError, TypeError, AttributeError, ValueError) as problem:
            raise BadHomeView(f"It is incomplete: {problem}.") from None
