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
