"""Which topics a base has, and the abilities that follow from them."""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace, _ArgumentGroup
from dataclasses import dataclass, field, replace

from robot.bases.base import Abilities, BadOption
from robot.ros.frames import Topic
from robot.ros.messages import BOOL, ODOMETRY, SENSOR_TYPES, TWIST

NAME = re.compile(r"/?[A-Za-z]\w*(/\w+)*", re.ASCII)
NONE = "none"
BUMP = "bump"


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of a base.

    Parameters
    ----------
    order
        Accepts geometry_msgs/Twist.
    odometry
        Publishes nav_msgs/Odometry; None for an open loop.
    sensors
        Topics of its hazards, by the hazard's code.
    """

    order: Topic
    odometry: Topic | None = None
    sensors: dict[str, Topic] = field(default_factory=dict)

    @property
    def abilities(self) -> Abilities:
        """What a base with these topics can do."""
        return Abilities(
            simulated=False,
            moves=True,
            real_time=True,
            closed_loop=self.odometry is not None,
            bumpers=BUMP in self.sensors,
        )

    def chosen(self, options: Namespace) -> Topics:
        """Return these with the topics of a command line in their place. Raises BadOption."""
        order = replace(self.order, name=options.cmd_topic or self.order.name)
        _check_name("--cmd-topic", order.name)
        odometry = self.odometry
        if options.odom_topic:
            odometry = Topic(options.odom_topic, ODOMETRY) if options.odom_topic != NONE else None
        if odometry is not None:
            _check_name("--odom-topic", odometry.name)
        sensors = dict(self.sensors)
        for hazard, option in SENSOR_OPTIONS.items():
            text: str = getattr(options, f"{option}_topic")
            if text == NONE:
                sensors.pop(hazard, None)
            elif text:
                kind = sensors[hazard].kind if hazard in sensors else BOOL
                sensors[hazard] = _read_sensor(f"--{option.replace('_', '-')}-topic", text, kind)
        return Topics(order, odometry, sensors)


SENSOR_OPTIONS = {BUMP: "bumper", "cliff": "cliff", "wheel_drop": "wheel_drop"}

PROFILES = {
    # What kobuki_node has without remappings, and the original's nodes publish on
    # (docs/reference/original.md#robot).
    "kobuki": Topics(
        Topic("/mobile_base/commands/velocity", TWIST),
        Topic("/odom", ODOMETRY),
        {
            BUMP: Topic("/mobile_base/events/bumper", "kobuki_msgs/BumperEvent"),
            "cliff": Topic("/mobile_base/events/cliff", "kobuki_msgs/CliffEvent"),
            "wheel_drop": Topic("/mobile_base/events/wheel_drop", "kobuki_msgs/WheelDropEvent"),
        },
    ),
    "plain": Topics(Topic("/cmd_vel", TWIST), Topic("/odom", ODOMETRY)),
}
DEFAULT_PROFILE = "kobuki"


def add_topic_arguments(group: ArgumentParser | _ArgumentGroup) -> None:
    """Add options for the topics of a base to a command line."""
    group.add_argument(
        "--ros-robot",
        choices=sorted(PROFILES),
        default=DEFAULT_PROFILE,
        help="which topics it has: a Kobuki's with its sensors, or /cmd_vel and /odom alone "
        f"(default: {DEFAULT_PROFILE})",
    )
    group.add_argument("--cmd-topic", metavar="TOPIC", help="that takes Twists")
    group.add_argument(
        "--odom-topic", metavar="TOPIC", help=f"that gives Odometry; {NONE}: an open loop"
    )
    for hazard, option in SENSOR_OPTIONS.items():
        group.add_argument(
            f"--{option.replace('_', '-')}-topic",
            metavar="TOPIC[:TYPE]",
            help=f"that stops it ({hazard}), of the type {BOOL} or a Kobuki's; {NONE}: has none",
        )


def read_topics(options: Namespace) -> Topics:
    """Return the topics of a command line. Raises BadOption."""
    return PROFILES[options.ros_robot].chosen(options)


def _read_sensor(option: str, text: str, kind: str) -> Topic:
    name, _, named = text.partition(":")
    _check_name(option, name)
    if named and named not in SENSOR_TYPES:
        raise BadOption(
            f"{option}: no {named} is read here. Known types: {', '.join(SENSOR_TYPES)}."
        )
    return Topic(name, named or kind)


def _check_name(option: str, name: str) -> None:
    if NAME.fullmatch(name) is None:
        raise BadOption(f"{option}: {name!r} is no ROS topic. Write it like /cmd_vel.")
