"""Messages of ROS 1 as JSON: written and read, with every number checked.

Every number that comes in is checked: a bridge passes on NaN, text and anything else that it gets
(docs/reference/rosbridge.md#behavior). Axes are those of ``robot.motion``, which are those of ROS
(REP 103).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from robot.motion.pose import Pose
from robot.motion.twist import Twist
from robot.ros.frames import BadRosFrame

TWIST = "geometry_msgs/Twist"
ODOMETRY = "nav_msgs/Odometry"
BOOL = "std_msgs/Bool"
STRING = "std_msgs/String"
# Type of an event: the name of its field that says which sensor it was. Its field ``state`` is 1
# while it is pressed, sees an edge, or hangs free (kobuki_msgs).
EVENTS = {
    "kobuki_msgs/BumperEvent": "bumper",
    "kobuki_msgs/CliffEvent": "sensor",
    "kobuki_msgs/WheelDropEvent": "wheel",
}
SENSOR_TYPES = (*EVENTS, BOOL)

# Larger distances [m] and speeds [m/s, rad/s] are impossible for our bases, and refused.
FARTHEST_M = 1e6
FASTEST = 100.0

Message = Mapping[str, Any]


def write_twist(twist: Twist) -> dict[str, Any]:
    """Return a geometry_msgs/Twist."""
    return {
        "linear": {"x": twist.v_m_s, "y": 0.0, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": twist.w_rad_s},
    }


def read_twist(message: Message) -> Twist:
    """Read a geometry_msgs/Twist. Raises BadRosFrame."""
    return Twist(
        _number(message, FASTEST, "linear", "x"), _number(message, FASTEST, "angular", "z")
    )


def read_odometry(message: Message) -> tuple[Pose, Twist]:
    """Read a nav_msgs/Odometry: pose in its own frame, and velocity. Raises BadRosFrame."""
    x, y, z, w = (_number(message, 2.0, "pose", "pose", "orientation", axis) for axis in "xyzw")
    if abs(math.hypot(x, y, z, w) - 1) > 0.1:
        raise BadRosFrame("An orientation is a unit quaternion.")
    heading_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    x_m, y_m = (_number(message, FARTHEST_M, "pose", "pose", "position", axis) for axis in "xy")
    twist = Twist(
        _number(message, FASTEST, "twist", "twist", "linear", "x"),
        _number(message, FASTEST, "twist", "twist", "angular", "z"),
    )
    return Pose(x_m, y_m, heading_rad), twist


def read_event(kind: str, message: Message) -> tuple[int, bool]:
    """Read an event: which sensor, and whether it detects a hazard. Raises BadRosFrame."""
    if kind == BOOL:
        data = message.get("data")
        if not isinstance(data, bool):
            raise BadRosFrame('"data" of a Bool is true or false.')
        return 0, data
    which, state = message.get(EVENTS[kind]), message.get("state")
    if type(which) is not int or type(state) is not int or not 0 <= which <= 255:
        raise BadRosFrame("An event says which sensor it was, and its state.")
    return which, state != 0


def _number(message: Any, most: float, *path: str) -> float:
    for name in path:
        message = message.get(name) if isinstance(message, dict) else None
    if isinstance(message, bool) or not isinstance(message, (int, float)):
        raise BadRosFrame(f"{'.'.join(path)} is a number.")
    if not abs(message) <= most:
        raise BadRosFrame(f"{'.'.join(path)} is not within ±{most:g}.")
    return float(message)
