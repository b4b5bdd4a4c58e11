"""Which topics a base has, and the abilities that follow from them."""

from __future__ import annotations

from dataclasses import dataclass, field

from robot.bases.base import Abilities
from robot.bases.rosbridge.joints import FASTEST_RAD_S, Joints, JointServer
from robot.bases.rosbridge.voice_and_joints import Voice
from robot.ros.frames import Topic
from robot.ros.messages import (
    BATTERY,
    BOOL,
    DOCK,
    FOLLOW,
    HAZARDS,
    JOINT_STATE,
    ODOMETRY,
    STRING,
    TRAJECTORY,
    TWIST,
    TWIST_STAMPED,
)

BUMP = "bump"
# The code of a button that stops it, which a person's hand has pressed.
STOP_BUTTON = "stop_button"
# The code of a Create 3's topic of hazards: all of them come on one.
ALL_HAZARDS = "hazards"

# The relay that stops the base if our orders cease (deploy/ros/garry_watchdog.py): what it listens
# to, and where it reports, ten times a second, which topic it serves.
RELAY_INPUT = "/garry/cmd_vel"
RELAY_ALIVE = Topic("/garry/watchdog", STRING)


@dataclass(frozen=True, slots=True)
class TurretTopic:
    """Where the angle of a base's turret is told.

    Parameters
    ----------
    topic
        Publishes sensor_msgs/JointState.
    joint
        The turret's name there.
    ahead_m
        How far the turret is ahead of the wheels' axle [m].
    """

    topic: Topic
    joint: str
    ahead_m: float


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
    mode
        Reports which mode its driver is in, and the one in which it is driven.
    turret
        Reports how its body stands on its wheels, where that turns; its odometry is its axle's.
    holonomic
        Whether it takes a velocity to the left, too.
    takes_relay
        Whether it takes orders while another program publishes on their topic, too.
    joint_server
        What moves its head or arms, where that is known.
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
    mode: tuple[Topic, str] | None = None
    turret: TurretTopic | None = None
    holonomic: bool = False
    takes_relay: bool = True
    joint_server: JointServer | None = None
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
        topics += [self.voice.topic] if self.voice is not None else []
        if self.joints is not None and not self.joints.server.is_action:
            topics.append(self.joints.server.topic)
        return [topic for topic in topics if topic is not None]

    @property
    def subscribed(self) -> list[Topic]:
        """All that we listen to."""
        alive = RELAY_ALIVE if self.relay is not None else None
        mode = None if self.mode is None else self.mode[0]
        turret = None if self.turret is None else self.turret.topic
        joints = None if self.joints is None else self.joints.server.states
        topics = (self.order, self.odometry, *self.sensors.values(), self.dock, alive)
        topics += (mode, turret, joints)
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
            holonomic=self.holonomic,
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


# A Stretch's driver takes the velocity of a point for the largest on the way, and 0 for none; it
# moves the head on after a goal was canceled (docs/reference/rosbridge.md#names-of-a-stretch). Its
# lift and arm, which go by meters, are left out.
_STRETCH = JointServer(
    Topic("/stretch_controller/follow_joint_trajectory", FOLLOW),
    (
        *("joint_head_pan", "joint_head_tilt"),
        *("joint_wrist_yaw", "joint_wrist_pitch", "joint_wrist_roll"),
    ),
    states=Topic("/stretch/joint_states", JOINT_STATE),
    end_rad_s=FASTEST_RAD_S,
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
    # A Stretch (docs/reference/rosbridge.md#names-of-a-stretch): it looks up a little, or down.
    "stretch": Topics(
        Topic("/stretch/cmd_vel", TWIST),
        Topic("/odom", ODOMETRY),
        {STOP_BUTTON: Topic("/is_runstopped", BOOL)},
        dock=Topic("/battery", BATTERY),
        mode=(Topic("/mode", STRING), "navigation"),
        joint_server=_STRETCH,
        joints=Joints(_STRETCH, _STRETCH.names[:2], (0.0, 0.0), (0.0, 0.25), (0.0, -0.5)),
    ),
    # A Quori (docs/reference/rosbridge.md#names-of-a-quori).
    "quori": Topics(
        Topic("/quori/base_controller/cmd_vel", TWIST),
        Topic("/quori/base_controller/odom", ODOMETRY),
        turret=TurretTopic(Topic("/joint_states", JOINT_STATE), "turret", 0.1),
        holonomic=True,
        takes_relay=False,
        joint_server=JointServer(
            Topic("/quori/joint_trajectory_controller/command", TRAJECTORY),
            (
                *("r_shoulder_pitch", "r_shoulder_roll"),
                *("l_shoulder_pitch", "l_shoulder_roll", "waist_pitch"),
            ),
            takes_all=True,
        ),
    ),
    "plain": Topics(Topic("/cmd_vel", TWIST), Topic("/odom", ODOMETRY)),
}
DEFAULT_PROFILE = "kobuki"
