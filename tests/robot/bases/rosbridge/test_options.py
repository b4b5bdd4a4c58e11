"""The rosbridge base's options on a command line."""

import pytest

from robot.bases import BadOption
from robot.bases.rosbridge.topics import PROFILES
from robot.ros.frames import Topic
from tests.support.rosbridge_stage import base_of


def test_its_topics_are_chosen():
    base = base_of("--ros-robot", "plain", "--ros-url", "ws://robot:9090")
    assert (base.port, base._client.topics) == ("ws://robot:9090", PROFILES["plain"])
    assert not base.abilities.bumpers
    base = base_of("--cmd-topic", "/mux/in", "--cliff-topic", "none", "--bumper-topic", "/b")
    topics = base._client.topics
    assert topics.order == Topic("/mux/in", "geometry_msgs/Twist")
    assert topics.sensors["bump"] == Topic("/b", "kobuki_msgs/BumperEvent")
    assert set(topics.sensors) == {"bump", "wheel_drop"}
    base = base_of("--ros-robot", "plain", "--bumper-topic", "/b", "--odom-topic", "none")
    assert base._client.topics.sensors["bump"].kind == "std_msgs/Bool"
    assert (base.abilities.bumpers, base.abilities.closed_loop) == (True, False)


def test_only_a_base_that_stops_by_itself_needs_no_relay():
    assert base_of()._client.topics.relay.name == "/garry/cmd_vel"
    assert base_of("--own-timeout-s", "0.6")._client.topics.relay is None


QUORI = ["--ros-robot", "quori", "--own-timeout-s", "0.25"]
ARMS = ["--pose-rest=0,0,0,0,0", "--pose-glad=0.5,0,0.5,0,0", "--pose-sad=0,0,0,0,-0.3"]


def test_a_stretch_and_a_quori_are_known_by_name():
    stretch = base_of("--ros-robot", "stretch", "--ros-url", "ws://robot:9090")
    assert stretch._client.topics == PROFILES["stretch"]
    assert (stretch.abilities.answers, stretch.abilities.holonomic) == (True, False)
    quori = base_of(*QUORI)
    assert (quori.abilities.answers, quori.abilities.holonomic) == (False, True)
    assert (
        base_of(*QUORI, *ARMS)._client.topics.joints.names == PROFILES["quori"].joint_server.names
    )


def test_head_and_arms_of_a_known_robot_are_chosen():
    words = ["--joints", "joint_wrist_yaw", "--pose-rest=0", "--pose-glad=1", "--pose-sad=0"]
    joints = base_of("--ros-robot", "stretch", *words)._client.topics.joints
    assert (joints.server, joints.names) == (PROFILES["stretch"].joint_server, ("joint_wrist_yaw",))
    assert not base_of("--ros-robot", "stretch", "--joints-topic", "none").abilities.answers
    action = "/arm/follow_joint_trajectory:control_msgs/action/FollowJointTrajectory"
    words = ["--joints-topic", action, *words]
    server = base_of("--ros-robot", "plain", *words)._client.topics.joints.server
    assert (server.is_action, server.states, server.end_rad_s) == (True, None, 0.0)


def test_any_base_has_a_button_that_stops_it():
    base = base_of("--ros-robot", "plain", "--stop-topic", "/e_stop")
    assert base._client.topics.sensors["stop_button"] == Topic("/e_stop", "std_msgs/Bool")
    assert not base.abilities.bumpers


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (["--ros-robot", "quori"], "--own-timeout-s: a quori takes orders of one program alone"),
        (["--ros-robot", "stretch", "--joints", "joint_lift"], "--joints: name some of"),
        ([*QUORI, *ARMS, "--joints", "waist_pitch"], "--joints: name all of r_shoulder_pitch"),
        (["--ros-robot", "stretch", "--pose-glad=0"], "--pose-rest: write an angle"),
        ([*QUORI, "--joints", "waist_pitch"], "--joints: name all of"),
    ],
)
def test_what_a_known_robot_does_not_take(words, cure):
    with pytest.raises(BadOption, match=cure):
        base_of(*words)


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (["--cmd-topic", "cmd vel"], "Write it like /cmd_vel"),
        (["--odom-topic", "/odom?"], "--odom-topic"),
        (["--bumper-topic", "/b:sensor_msgs/Range"], "Known types: kobuki_msgs/BumperEvent"),
    ],
)
def test_topics_that_cannot_be(words, cure):
    with pytest.raises(BadOption, match=cure):
        base_of(*words)


@pytest.mark.parametrize("url", ["robot:9090", "http://robot:9090", "ws://", "ws://robot:x"])
def test_an_address_that_cannot_be(url, capsys):
    with pytest.raises(SystemExit):
        base_of("--ros-url", url)
    assert "ws://192.168.1.20:9090" in capsys.readouterr().err
