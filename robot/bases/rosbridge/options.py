"""The topics of a base on a command line."""

from __future__ import annotations

import math
import re
from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Collection
from dataclasses import replace

from robot.bases.base import BadOption
from robot.bases.rosbridge.joints import LONGEST_S, Joints, JointServer
from robot.bases.rosbridge.topics import (
    BUMP,
    DEFAULT_PROFILE,
    PROFILES,
    RELAY_INPUT,
    STOP_BUTTON,
    Topics,
)
from robot.bases.rosbridge.voice_and_joints import Voice
from robot.ros.frames import Topic
from robot.ros.messages import (
    BOOL,
    FOLLOW,
    ODOMETRY,
    SENSOR_TYPES,
    STRING,
    TRAJECTORY,
    TWISTS,
    without_msg,
)
from robot.ros.signals import LIGHT_TYPES, SOUND_TYPES

NAME = re.compile(r"/?[A-Za-z]\w*(/\w+)*", re.ASCII)
NONE = "none"
POSES = {"rest": "at rest", "glad": "after a strong window", "sad": "after a weak one"}
SENSOR_OPTIONS = {
    BUMP: "bumper",
    "cliff": "cliff",
    "wheel_drop": "wheel_drop",
    STOP_BUTTON: "stop",
}

# A base that goes on for longer than this [s] without orders is not watched by its own timeout.
LONGEST_TIMEOUT_S = 1.0


def add_topic_arguments(group: ArgumentParser | _ArgumentGroup) -> None:
    """Add options for the topics of a base to a command line."""
    group.add_argument(
        "--ros-robot",
        choices=sorted(PROFILES),
        default=DEFAULT_PROFILE,
        help="which topics it has: a Kobuki's (of ROS 1 or 2), a TurtleBot 4's, a Stretch's, a "
        f"Quori's, or /cmd_vel and /odom alone (default: {DEFAULT_PROFILE})",
    )
    group.add_argument(
        "--cmd-topic", metavar="TOPIC[:TYPE]", help="that takes Twists, or TwistStamped"
    )
    group.add_argument(
        "--odom-topic", metavar="TOPIC", help=f"that gives Odometry; {NONE}: an open loop"
    )
    for hazard, option in SENSOR_OPTIONS.items():
        group.add_argument(
            f"--{option.replace('_', '-')}-topic",
            metavar="TOPIC[:TYPE]",
            help=f"that stops it ({hazard}), of the type {BOOL} or a Kobuki's; {NONE}: has none",
        )
    for name in ("light", "sound"):
        group.add_argument(
            f"--{name}-topic",
            metavar="TOPIC:TYPE",
            help=f"of its {name}, which announces that it moves; {NONE}: has none",
        )
    group.add_argument(
        "--speech-topic",
        metavar="TOPIC",
        help=f"that says its words aloud ({STRING}), see --say-glad and --say-sad",
    )
    group.add_argument(
        "--joints-topic",
        metavar="TOPIC[:TYPE]",
        help=f"that moves its head or arms ({TRAJECTORY}, or an action {FOLLOW}); {NONE}: has none",
    )
    group.add_argument("--joints", default="", metavar="NAME,…", help="the names of these joints")
    for pose, when in POSES.items():
        group.add_argument(
            f"--pose-{pose}",
            default="",
            metavar="RAD,…",
            help=f"their angles {when}, as in --pose-{pose}=0,-0.3",
        )
    group.add_argument(
        "--own-timeout-s",
        type=float,
        metavar="S",
        help="the base itself stands still after so long without an order, as you have tried with "
        f"its wheels off the floor; without this the watchdog relay at {RELAY_INPUT} has to run",
    )


def read_topics(options: Namespace) -> Topics:
    """Return the topics of a command line. Raises BadOption."""
    profile = PROFILES[options.ros_robot]
    order = profile.order
    if options.cmd_topic:
        order = _read_topic("--cmd-topic", options.cmd_topic, TWISTS, order.kind)
    odometry = profile.odometry
    if options.odom_topic:
        odometry = None
        if options.odom_topic != NONE:
            odometry = _read_topic("--odom-topic", options.odom_topic, (ODOMETRY,), ODOMETRY)
    sensors = dict(profile.sensors)
    for hazard, option in SENSOR_OPTIONS.items():
        text: str = getattr(options, f"{option}_topic")
        if text == NONE:
            sensors.pop(hazard, None)
        elif text:
            kind = sensors[hazard].kind if hazard in sensors else BOOL
            name = f"--{option.replace('_', '-')}-topic"
            sensors[hazard] = _read_topic(name, text, SENSOR_TYPES, kind)
    light, sound = (
        _read_signal(f"--{name}-topic", getattr(options, f"{name}_topic"), types, was)
        for name, types, was in (
            ("light", LIGHT_TYPES, profile.light),
            ("sound", SOUND_TYPES, profile.sound),
        )
    )
    timeout_s = options.own_timeout_s
    if timeout_s is not None and not 0 < timeout_s <= LONGEST_TIMEOUT_S:
        raise BadOption(
            f"--own-timeout-s: a base that goes on for {timeout_s:g} s is not watched; up to "
            f"{LONGEST_TIMEOUT_S:g} s is. Leave it out, and start the watchdog relay."
        )
    if timeout_s is None and not profile.takes_relay:
        raise BadOption(
            f"--own-timeout-s: a {options.ros_robot} takes orders of one program alone, so no "
            f"relay can watch it. Try with its wheels off the floor how soon it stands by itself "
            f"(0.25 s by its driver's settings), and give that."
        )
    return replace(
        profile,
        order=order,
        odometry=odometry,
        sensors=sensors,
        light=light,
        sound=sound,
        voice=_read_voice(options),
        joints=_read_joints(options, profile),
        own_timeout_s=timeout_s,
    )


def _read_signal(
    option: str, text: str | None, types: Collection[str], profile: Topic | None
) -> Topic | None:
    if not text:
        return profile
    if text == NONE:
        return None
    return _read_topic(option, text, types, profile.kind if profile is not None else "")


def _read_voice(options: Namespace) -> Voice | None:
    text = options.speech_topic
    if not text:
        return None
    topic = _read_topic("--speech-topic", text, (STRING,), STRING)
    return Voice(topic, options.say_glad, options.say_sad)


def _read_joints(options: Namespace, profile: Topics) -> Joints | None:
    server = profile.joint_server
    if options.joints_topic == NONE:
        return None
    if options.joints_topic:
        kinds = (TRAJECTORY, FOLLOW)
        topic = _read_topic("--joints-topic", options.joints_topic, kinds, TRAJECTORY)
        server = JointServer(topic)
    is_posed = any(getattr(options, f"pose_{one}") for one in POSES)
    if server is None or not (options.joints_topic or options.joints or is_posed):
        return profile.joints
    usual = profile.joints.names if profile.joints is not None else ()
    named = options.joints or ",".join(server.names if server.takes_all else usual)
    names = tuple(named.split(","))
    if not all(NAME.fullmatch(name) for name in names):
        raise BadOption("--joints: name the joints, like --joints head_pan,head_tilt.")
    unknown = set(names) - set(server.names) if server.names else ()
    if unknown or (server.takes_all and len(names) < len(server.names)):
        what = "all of" if server.takes_all else "some of"
        raise BadOption(f"--joints: name {what} {', '.join(server.names)}.")
    rest, glad, sad = (_read_pose(f"--pose-{one}", options, len(names)) for one in POSES)
    joints = Joints(server, names, rest, glad, sad)
    if joints.takes_s > LONGEST_S:
        raise BadOption(
            f"--pose-glad, --pose-sad: from one pose to another it takes {joints.takes_s:.1f} s, "
            f"and no stop may reach it; up to {LONGEST_S:g} s is allowed. Choose smaller angles."
        )
    return joints


def _read_pose(option: str, options: Namespace, count: int) -> tuple[float, ...]:
    text = getattr(options, option.removeprefix("--").replace("-", "_"))
    try:
        angles_rad = tuple(map(float, text.split(",")))
    except ValueError:
        angles_rad = ()
    if len(angles_rad) != count or not all(abs(angle) <= math.pi for angle in angles_rad):
        raise BadOption(f"{option}: write an angle within ±3.14 rad for each of --joints.")
    return angles_rad


def _read_topic(option: str, text: str, types: Collection[str], kind: str) -> Topic:
    name, _, named = text.partition(":")
    if NAME.fullmatch(name) is None:
        raise BadOption(f"{option}: {name!r} is no ROS topic. Write it like /cmd_vel.")
    kind = named or kind
    if without_msg(kind) not in types:
        known = ", ".join(types)
        raise BadOption(f"{option}: no {kind or 'type'} is read here. Known types: {known}.")
    return Topic(name, kind)
