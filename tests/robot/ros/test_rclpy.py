"""What a Stretch and a Quori are sent and tell, as messages of real ROS 2."""

from typing import Any

import pytest

from robot.bases.rosbridge.topics import PROFILES
from robot.motion.twist import Twist
from robot.ros.messages import AT_CHARGER, read_flag, read_joints, read_twist, write_twist
from tests.support.fake_ros import wait_until
from tests.support.real_ros import Ros2, why_ros2_missing

pytestmark = [pytest.mark.ros, pytest.mark.realtime]


@pytest.fixture(scope="module")
def pass_through():
    """Give what a message of that type comes back as, through two nodes."""
    if reason := why_ros2_missing():
        pytest.skip(reason)
    with Ros2() as ros:
        there, back = ros.node("there"), ros.node("back")

        def pass_through(kind, message):
            topic, heard = f"/{kind.rpartition('/')[2].lower()}", list[dict[str, Any]]()
            back.subscribe(topic, kind, heard.append)
            there.advertise(topic, kind)

            def arrives():
                there.publish(topic, message)  # again until they have found each other
                return bool(heard)

            wait_until(arrives)
            return heard[0]

        yield pass_through


def test_a_trajectory_is_one(pass_through):
    joints = PROFILES["stretch"].joints
    sent = joints.write_trajectory(list(joints.sad_rad))
    there = pass_through("trajectory_msgs/msg/JointTrajectory", sent)
    (point,) = there["points"]
    assert there["joint_names"] == ["joint_head_pan", "joint_head_tilt"]
    assert (point["positions"], point["velocities"]) == ([0.0, -0.5], [0.5, 0.5])
    time = point["time_from_start"]
    assert time["sec"] + 1e-9 * time["nanosec"] == pytest.approx(joints.takes_s)
    assert there["header"]["stamp"] == {"sec": 0, "nanosec": 0}  # it begins now


def test_a_velocity_to_the_left_is_one(pass_through):
    twist = Twist(0.1, -0.5, 0.2)
    assert read_twist(pass_through("geometry_msgs/msg/Twist", write_twist(twist))) == twist


def test_where_joints_are_and_a_charger_are_read(pass_through):
    told = {"name": ["joint_head_pan", "joint_lift"], "position": [0.25, 0.5], "velocity": []}
    assert read_joints(pass_through("sensor_msgs/msg/JointState", told)) == {
        "joint_head_pan": 0.25,
        "joint_lift": 0.5,
    }
    told = pass_through("sensor_msgs/msg/BatteryState", {"present": True})
    assert read_flag(told, AT_CHARGER["sensor_msgs/BatteryState"])
