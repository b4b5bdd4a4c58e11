"""Which topics a base has, and the abilities that follow from them."""

from __future__ import annotations

from dataclasses import dataclass, field

from robot.bases.base import Abilities
from robot.bases.rosbridge.voice_and_joints import Joints, Voice
from robot.ros.frames import Topic
from robot.ros.messages import DOCK, HAZARDS, ODOMETRY, STRING, TWIST, TWIST_STAMPED

BUMP = "bump"
# The code of a Create 3's topic of hazards: all of them come on one.
ALL_HAZARDS = "hazards"

# The relay that stops the base if our orders cease (deploy/ros/garry_watchdog.py): what it listens
# to, and where it reports, ten times a second, which topic it serves.
RELAY_INPUT = "/garry/cmd_vel"
RELAY_ALIVE = Topic("/garry/watchdog", STRING)


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of a base.

    Parameters
    ----------
    order
        Accepts geometry_msgs/Twist or TwistStamped.
    odometry
        Publishes nav_msgs/Odometry; None for an open loop.
    sensors
        Topics of its hazards, by the hazard's code.
    light, sound
        Show and sound its state.
    dock
        Reports whether it stands at its charger.
    voice, joints
        By which it answers beside its motion.
    own_timeout_s
        After this long without an order the base stops by itself, as a person has tried; None where
        that is unknown, and the relay has to watch.
    """

    order: Topic
    odometry: Topic | None = None
    sensors: dict[str, Topic] = field(default_factory=dict)
    light: Topic | None = None
    sound: Topic | None = None
    dock: Topic | None = None
    voice: Voice | None = None
    joints: Joints | None = None
    own_timeout_s: float | None = None

    @property
    def relay(self) -> Topic | None:
        """Where the relay takes orders; None for a base with a timeout of its own."""
        return Topic(RELAY_INPUT, self.order.kind) if self.own_timeout_s is None else None

    @property
    def published(self) -> list[Topic]:
        """All that we publish on."""
        topics = [self.order, self.relay, self.light, self.sound]
        topics += [one.topic for one in (self.voice, self.joints) if one is not None]
        return [topic for topic in topics if topic is not None]

    @property
    def subscribed(self) -> list[Topic]:
        """All that we listen to."""
        alive = RELAY_ALIVE if self.relay is not None else None
        topics = (self.order, self.odometry, *self.sensors.values(), self.dock, alive)
        return [topic for topic in topics if topic is not None]

    @property
    def abilities(self) -> Abilities:
        """What a base with these topics can do."""
        return Abilities(
            simulated=False,
            moves=True,
            announces=self.light is not None or self.sound is not None,
            answers=self.voice is not None or self.joints is not None,
            real_time=True,
            closed_loop=self.odometry is not None,
            bumpers=BUMP in self.sensors or ALL_HAZARDS in self.sensors,
        )


def _kobuki(root: str, package: str) -> Topics:
    """Return the topics of a Kobuki's node: their root, and the package of its messages."""
    return Topics(
        Topic(f"{root}/commands/velocity", TWIST),
        Topic("/odom", ODOMETRY),
        {
            BUMP: Topic(f"{root}/events/bumper", f"{package}/BumperEvent"),
            "cliff": Topic(f"{root}/events/cliff", f"{package}/CliffEvent"),
            "wheel_drop": Topic(f"{root}/events/wheel_drop", f"{package}/WheelDropEvent"),
        },
        light=Topic(f"{root}/commands/led1", f"{package}/Led"),
        sound=Topic(f"{root}/commands/sound", f"{package}/Sound"),
    )


PROFILES = {
    # What kobuki_node has without remappings, and the original's nodes publish on
    # (docs/reference/original.md#robot); on ROS 2 it is kobuki_ros
    # (docs/reference/rosbridge.md#names-of-a-kobuki).
    "kobuki": _kobuki("/mobile_base", "kobuki_msgs"),
    "kobuki-ros2": _kobuki("", "kobuki_ros_interfaces/msg"),
    # A Create 3 with a computer (docs/reference/rosbridge.md#names-of-a-turtlebot-4).
    "turtlebot4": Topics(
        Topic("/cmd_vel", TWIST_STAMPED),
        Topic("/odom", ODOMETRY),
        {ALL_HAZARDS: Topic("/hazard_detection", HAZARDS)},
        light=Topic("/cmd_lightring", "irobot_create_msgs/LightringLeds"),
        sound=Topic("/cmd_audio", "irobot_create_msgs/AudioNoteVector"),
        dock=Topic("/dock_status", DOCK),
    ),
    "plain": Topics(Topic("/cmd_vel", TWIST), Topic("/odom", ODOMETRY)),
}
DEFAULT_PROFILE = "kobuki"
