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
from robot.plugins import Registry, check_class

# Name: its class, made with a monotonic clock [s].
BASES: Registry[type[MobileBase]] = Registry(
    "garry.bases",
    {
        "avatar": AvatarBase,
        "null": NullBase,
        "kinematic": KinematicBase,
        "twin": TwinBase,
        "kobuki": KobukiBase,
        "rosbridge": RosbridgeBase,
    },
    check_class(MobileBase),
)

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
