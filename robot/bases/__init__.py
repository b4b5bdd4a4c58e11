"""The bases that can be driven, each in its own module or folder."""

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
from robot.plugins import Registry, check_class

# Name: its class, made with a monotonic clock [s]; its module is imported when it is asked for.
BASES: Registry[type[MobileBase]] = Registry(
    "garry.bases",
    {
        "avatar": "robot.bases.avatar:AvatarBase",
        "null": "robot.bases.null:NullBase",
        "kinematic": "robot.bases.kinematic:KinematicBase",
        "twin": "robot.bases.twinned:TwinBase",
        "kobuki": "robot.bases.kobuki:KobukiBase",
        "rosbridge": "robot.bases.rosbridge:RosbridgeBase",
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
