"""The bases that are known by name: ROS 1 and 2, their lights, sounds and hazards."""

from dataclasses import replace
from typing import Any

import pytest

from robot.bases.base import Indication
from robot.bases.rosbridge.topics import PROFILES
from robot.motion.twist import STILL, Twist
from robot.ros.frames import BadRosFrame, Publication, read_frame, to_text
from robot.ros.messages import read_event, read_hazards, read_twist, write_twist
from robot.ros.signals import LIGHT_TYPES, SOUND_TYPES, write_light, write_sound
from tests.support.rosbridge_stage import Stage, moving

STAMPED = "geometry_msgs/TwistStamped"


def stage_of(name, **more):
    return Stage(replace(PROFILES[name], own_timeout_s=0.6, **more))


@pytest.mark.parametrize("package", ["kobuki_msgs", "kobuki_ros_interfaces"])
@pytest.mark.parametrize("between", ["/", "/msg/"])
@pytest.mark.parametrize(
    ("event", "field"),
    [("BumperEvent", "bumper"), ("CliffEvent", "sensor"), ("WheelDropEvent", "wheel")],
)
def test_events_of_ros_1_and_2(package, between, event, field):
    kind = f"{package}{between}{event}"
    assert read_event(kind, {field: 2, "state": 1}) == (2, True)
    assert read_event(kind, {field: 0, "state": 0}) == (0, False)


@pytest.mark.parametrize(
    "bad", [{"bumper": "1"}, {"bumper": 256}, {"state": None}, {"state": True}]
)
def test_an_event_that_cannot_be_is_refused(bad):
    with pytest.raises(BadRosFrame):
        read_event("kobuki_msgs/BumperEvent", {"bumper": 1, "state": 1} | bad)


@pytest.mark.parametrize("kind", ["std_msgs/Bool", "std_msgs/msg/Bool"])
def test_any_bool_is_a_sensor(kind):
    assert read_event(kind, {"data": True}) == (0, True)


@pytest.mark.parametrize("kind", [STAMPED, "geometry_msgs/msg/TwistStamped"])
def test_a_stamped_twist_there_and_back(kind):
    message = write_twist(Twist(0.1, -0.5), kind)
    assert message["twist"]["linear"]["x"] == 0.1
    assert "header" not in message  # a time of ours would be another clock's
    assert read_twist(message, kind) == Twist(0.1, -0.5)


def test_the_hazards_of_a_create_3():
    detections = [{"type": number} for number in range(6)]
    assert read_hazards({"detections": detections}) == {
        "bump",
        "cliff",
        "over_current",
        "wheel_drop",
    }
    assert read_hazards({"detections": [{"type": 0}, {"type": 5}]}) == frozenset()


@pytest.mark.parametrize("name", [name for name, topics in PROFILES.items() if topics.light])
def test_it_announces_by_light_and_sound(name):
    stage = stage_of(name)
    assert stage.base.abilities.announces
    light, sound = stage.base_client.topics.light, stage.base_client.topics.sound
    shown, heard = list[Any](), list[Any]()
    stage.bridge.graph.subscribe(light.name, light.kind, shown.append)
    stage.bridge.graph.subscribe(sound.name, sound.kind, heard.append)
    stage.base.show(Indication.MOVING, aloud=True)
    stage.base.show(Indication.READY, aloud=False)
    stage.wait(0.1)
    assert shown == [write_light(light.kind, "moving"), write_light(light.kind, "ready")]
    assert heard == [write_sound(sound.kind, "moving")]
    stage.lose()
    stage.connect()
    stage.wait(0.1)
    assert shown[-1] == write_light(light.kind, "ready")
    assert not stage.bridge.log


@pytest.mark.parametrize("name", [name for name, topics in PROFILES.items() if topics.light])
def test_a_gesture_begins_after_its_announcement(name):
    stage = stage_of(name)
    for topic in stage.base_client.topics.sensors.values():
        stage.bridge.graph.advertise(topic.name, topic.kind, "/base")
    stage.wait(2.5)
    stage.perform()
    began_s = stage.now_s
    while not stage.robot.is_moving:
        stage.wait(0.02)
    assert 0.5 <= stage.now_s - began_s < 0.7


@pytest.mark.parametrize("kind", [*LIGHT_TYPES, "kobuki_ros_interfaces/msg/Led"])
def test_every_light_shows_every_state(kind):
    shown = [repr(write_light(kind, str(state))) for state in Indication]
    assert len(set(shown)) == len(Indication)


@pytest.mark.parametrize("kind", SOUND_TYPES)
def test_every_sound_tells_moving_from_stopped_and_rests_else(kind):
    assert write_sound(kind, "moving") != write_sound(kind, "stopped")
    assert write_sound(kind, "ready") is None
    assert write_sound(kind, "waiting") is None


def test_a_create_3_is_stopped_by_its_hazards_and_refused_at_its_dock():
    stage = stage_of("turtlebot4")
    stage.wait(0.1, Twist(0.1, 0))
    stage.tell("/hazard_detection", {"detections": [{"type": 1}]})
    assert stage.base.read().sensors.hazards == {"bump"}
    stage.tell("/hazard_detection", {"detections": []})
    stage.wait(0.2, STILL)
    assert not stage.base.read().sensors.hazards
    stage.tell("/dock_status", {"is_docked": True})
    assert stage.base.read().sensors.is_charging
    stage.tell("/dock_status", {"is_docked": "yes"})  # no answer is no change
    assert stage.base.read().sensors.is_charging


def test_odometry_that_moves_without_an_order_is_told(stage):
    stage.wait(1.5)
    stage.robot.v_m_s = 0.1
    message = stage.robot.message()
    for _ in range(12):
        stage.now_s += 0.02
        stage.base_client.handle(Publication("/odom", message), stage.now_s)
    assert "unordered_motion" in stage.base.read().sensors.hazards


def test_an_echo_that_is_40_ms_late_holds_nothing_up():
    """Of 100 orders in 2 s; with one on its way it was every second or third."""
    stage, late = Stage(), []
    stage.wait(0.3)
    for _ in range(100):
        stage.now_s += 0.02
        stage.base.drive(Twist(0.1, 0))
        for frame in stage.base_client.due(stage.now_s):
            stage.client.take(to_text(frame))
        late += [(stage.now_s + 0.04, text) for text in stage.inbox]
        stage.inbox.clear()
        while late and late[0][0] <= stage.now_s:
            stage.base_client.handle(read_frame(late.pop(0)[1]), stage.now_s)
    assert len(moving(stage)) >= 98
