"""The bases that can be driven, each in its own module or folder."""

from robot.bases.avatar import AvatarBase
from robot.bases.base import (
    Abilities,
    Answer,
    BadOption,
    BaseLost,
    BaseState,
    GroundTruth,
    Indication,
    MobileBase,
    SensorState,
)
from robot.bases.kinematic import KinematicBase
from robot.bases.kobuki import KobukiBase
from robot.bases.null import NullBase
from robot.bases.rosbridge import RosbridgeBase
from robot.bases.twinned import TwinBase

# Name: its class, made with a monotonic clock [s].
BASES: dict[str, type[MobileBase]] = {
    "avatar": AvatarBase,
    "null": NullBase,
    "kinematic": KinematicBase,
    "twin": TwinBase,
    "kobuki": KobukiBase,
    "rosbridge": RosbridgeBase,
}

__all__ = [
    "BASES",
    "Abilities",
    "Answer",
    "BadOption",
    "BaseLost",
    "BaseState",
    "GroundTruth",
    "Indication",
    "MobileBase",
    "SensorState",
]
