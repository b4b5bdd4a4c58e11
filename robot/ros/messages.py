"""Messages of ROS 1 and 2 as JSON: written and read, with every number checked.

Every number that comes in is checked: a bridge passes on NaN, text and anything else that it gets
(docs/reference/rosbridge.md#behavior). Axes are those of ``robot.motion``, which are those of ROS
(REP 103). A type is ``package/Type`` in ROS 1 and ``package/msg/Type`` in ROS 2; a rosbridge of
ROS 2 takes both (docs/reference/rosbridge.md#messages), and so do we.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from robot.motion.pose import Pose
from robot.motion.twist import Twist
from robot.ros.frames import BadRosFrame
from robot.wire.frames import to_number

TWIST = "geometry_msgs/Twist"
TWIST_STAMPED = "geometry_msgs/TwistStamped"
TWISTS = (TWIST, TWIST_STAMPED)
ODOMETRY = "nav_msgs/Odometry"
BOOL = "std_msgs/Bool"
STRING = "std_msgs/String"
HAZARDS = "irobot_create_msgs/HazardDetectionVector"
DOCK = "irobot_create_msgs/DockStatus"
BATTERY = "sensor_msgs/BatteryState"
# The flag of a message that says whether it stands at a charger. A Stretch's ``present`` does, not
# whether it has a battery (docs/reference/rosbridge.md#names-of-a-stretch).
AT_CHARGER = {DOCK: "is_docked", BATTERY: "present"}
JOINT_STATE = "sensor_msgs/JointState"
TRAJECTORY = "trajectory_msgs/JointTrajectory"
FOLLOW = "control_msgs/action/FollowJointTrajectory"
# Type of an event: the name of its field that identifies the sensor. Its field ``state`` is 1
# while it is pressed, sees an edge, or hangs free (kobuki_msgs, kobuki_ros_interfaces).
EVENT_FIELDS = {"BumperEvent": "bumper", "CliffEvent": "sensor", "WheelDropEvent": "wheel"}
EVENTS = {
    f"{package}/{event}": field
    for package in ("kobuki_msgs", "kobuki_ros_interfaces")
    for event, field in EVENT_FIELDS.items()
}
SENSOR_TYPES = (*EVENTS, BOOL, HAZARDS)
# What a Create 3 detects (irobot_create_msgs/HazardDetection); it has others, which stop nothing.
CREATE_HAZARDS = {1: "bump", 2: "cliff", 3: "over_current", 4: "wheel_drop"}

# Larger distances [m] and speeds [m/s, rad/s] are impossible for our bases, and refused.
FARTHEST_M = 1e6
LATEST_S = 1e11
FASTEST = 100.0

Message = Mapping[str, Any]


def without_msg(kind: str) -> str:
    """Return a type as ROS 1 writes it."""
    return kind.replace("/msg/", "/")


def write_twist(twist: Twist, kind: str = TWIST) -> dict[str, Any]:
    """Return a twist as a message.

    Parameters
    ----------
    twist
        The velocity.
    kind
        Type of the topic: geometry_msgs/Twist or TwistStamped. The latter gets no time, which a
        base takes as now.
    """
    message = {
        "linear": {"x": twist.v_m_s, "y": twist.vy_m_s, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": twist.w_rad_s},
    }
    return {"twist": message} if without_msg(kind) == TWIST_STAMPED else message


def read_twist(message: Message, kind: str = TWIST) -> Twist:
    """Read a geometry_msgs/Twist, or a TwistStamped. Raises BadRosFrame.

    Parameters
    ----------
    message
        What came on the topic.
    kind
        Its type, as ROS 1 or 2 writes it.
    """
    path = ("twist",) if without_msg(kind) == TWIST_STAMPED else ()
    return _read_velocity(message, *path)


def read_odometry(message: Message) -> tuple[Pose, Twist]:
    """Read a nav_msgs/Odometry: pose in its own frame, and velocity. Raises BadRosFrame."""
    x, y, z, w = (_number(message, 2.0, "pose", "pose", "orientation", axis) for axis in "xyzw")
    if abs(math.hypot(x, y, z, w) - 1) > 0.1:
        raise BadRosFrame("An orientation is a unit quaternion.")
    heading_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    x_m, y_m = (_number(message, FARTHEST_M, "pose", "pose", "position", axis) for axis in "xy")
    return Pose(x_m, y_m, heading_rad), _read_velocity(message, "twist", "twist")


def read_stamp_s(message: Message) -> float:
    """Read when a message of ROS 1 was made, by its header [s]. Raises BadRosFrame."""
    seconds, rest_ns = (
        _number(message, LATEST_S, "header", "stamp", name) for name in ("secs", "nsecs")
    )
    return seconds + 1e-9 * rest_ns


def read_joints(message: Message) -> dict[str, float]:
    """Read where joints are, by their names [rad, m], of a JointState. Raises BadRosFrame."""
    names, positions = message.get("name"), message.get("position")
    if not (isinstance(names, list) and isinstance(positions, list)):
        raise BadRosFrame('"name" and "position" are lists.')
    there = {
        name: to_number(position, -FARTHEST_M, FARTHEST_M)
        for name, position in zip(names, positions, strict=False)
        if isinstance(name, str)
    }
    return {name: position for name, position in there.items() if position is not None}


def read_event(kind: str, message: Message) -> tuple[int, bool]:
    """Read an event: which sensor, and whether it detects a hazard. Raises BadRosFrame.

    Parameters
    ----------
    kind
        Type of the topic: one of ``EVENTS``, or ``BOOL``, as ROS 1 or 2 writes it.
    message
        What came on the topic.
    """
    kind = without_msg(kind)
    if kind == BOOL:
        return 0, read_flag(message, "data")
    which, state = message.get(EVENTS[kind]), message.get("state")
    if type(which) is not int or type(state) is not int or not 0 <= which <= 255:
        raise BadRosFrame("An event says which sensor it was, and its state.")
    return which, state != 0


def read_hazards(message: Message) -> frozenset[str]:
    """Read what a Create 3 detects now, as our codes. Raises BadRosFrame."""
    detections = message.get("detections")
    if not isinstance(detections, list):
        raise BadRosFrame('"detections" is a list.')
    types = [one.get("type") if isinstance(one, dict) else None for one in detections]
    if not all(type(one) is int for one in types):
        raise BadRosFrame("A detection has a type.")
    return frozenset(CREATE_HAZARDS[one] for one in types if one in CREATE_HAZARDS)


def read_flag(message: Message, name: str) -> bool:
    """Return the field ``name`` of ``message``. Raises BadRosFrame where it is no true or false."""
    value = message.get(name)
    if not isinstance(value, bool):
        raise BadRosFrame(f'"{name}" is true or false.')
    return value


def _read_velocity(message: Message, *path: str) -> Twist:
    parts = (("linear", "x"), ("angular", "z"), ("linear", "y"))
    return Twist(*(_number(message, FASTEST, *path, *part) for part in parts))


def _number(message: Any, most: float, *path: str) -> float:
    for name in path:
        message = message.get(name) if isinstance(message, dict) else None
    number = to_number(message, -most, most)
    if number is None:
        raise BadRosFrame(f"{'.'.join(path)} is a number within ±{most:g}.")
    return number
