"""The base that ROS drives and the original's topics, with nodes of rospy behind the bridge."""

import json
import math
import time

import pytest
from websockets.sync.client import connect

from robot.motion.gestures import GESTURES
from robot.motion.twist import STILL, Twist
from robot.original_connection import OriginalTopics
from robot.play_gesture import play_gesture
from tests.support.driven_ros import come_back, lose_while_moving, open_base, wired_base
from tests.support.fake_ros import (
    FakeBase,
    FakeRosbridge,
    ServedRos,
    Ticking,
    drive,
    release,
    wait_until,
)
from tests.support.real_ros import RosMaster, why_missing
from tests.support.rosbridge_stage import BUMPER, CLOSED

pytestmark = [pytest.mark.ros, pytest.mark.realtime]


@pytest.fixture(scope="module")
def master():
    if reason := why_missing():
        pytest.skip(reason)
    with RosMaster() as master:
        yield master


@pytest.fixture(scope="module")
def ros(master):
    """Return a bridge of which the graph is a node of rospy, and a base that is another one."""
    node = master.node("base")
    bridge = FakeRosbridge(master.node("rosbridge"), has_rosapi=False)
    robot = FakeBase(node, time.monotonic)
    node.advertise(BUMPER.name, BUMPER.kind)
    with ServedRos(bridge) as served, Ticking(robot):
        served.robot, served.node = robot, node
        yield served


def test_a_node_of_rospy_receives_twists_and_its_odometry_closes_the_loop(ros):
    start = ros.robot.x_m, ros.robot.y_m
    with open_base(ros.url, CLOSED) as base:
        release(base)
        played = play_gesture(GESTURES["celebrate"], base, time.monotonic, time.sleep)
    assert played["outcome"] == "done"
    assert 0.02 < played["farthest_m"] < 0.1
    assert math.dist(start, (ros.robot.x_m, ros.robot.y_m)) < 0.02
    assert any(order[1] > 0 for order in ros.robot.orders)
    wait_until(lambda: ros.robot.orders[-1][1:] == (0.0, 0.0))
    assert not ros.bridge.log


def test_a_bumper_of_a_node_stops_it(ros):
    with open_base(ros.url, CLOSED) as base:
        release(base)
        drive(base, Twist(0.1, 0), lambda: ros.robot.is_moving)
        ros.node.publish(BUMPER.name, {"data": True})
        drive(base, Twist(0.1, 0), lambda: "bump" in base.read().sensors.hazards)
        ros.node.publish(BUMPER.name, {"data": False})
        drive(base, STILL, lambda: not base.read().sensors.hazards)


def test_a_reconnection_replays_nothing(ros):
    with wired_base(ros, CLOSED) as (wire, base):
        lose_while_moving(ros, wire, base)
        wait_until(lambda: not ros.robot.is_moving)  # by its own timeout: nobody else can
        assert come_back(ros, wire, base) == {(0.0, 0.0)}


def test_the_original_s_nodes_hear_what_they_expect(ros, master):
    original = master.node("gesture_generation")
    heard = []
    with OriginalTopics(ros.url) as originals:
        wait_until(lambda: originals.problem == "")
        originals.allow(True)
        originals.handle_message({"type": "welcome", "session": 7, "valence": "positive"})
        # As gesture_generation.py and data_processing.py subscribe.
        for topic, kind in (
            ("/garry/good_step", "std_msgs/Bool"),
            ("/garry/feedback_type", "std_msgs/String"),
            ("/garry/data", "garry_ros/UserData"),
        ):
            original.subscribe(topic, kind, lambda said, topic=topic: heard.append((topic, said)))
        wait_until(lambda: ("/garry/feedback_type", {"data": "Positive"}) in heard)
        wait_until(lambda: _tell(originals, heard, "/garry/good_step"))
        wait_until(lambda: _tell(originals, heard, "/garry/data"))
        # The original's MATLAB client at the same bridge, by its own words.
        with connect(ros.url) as matlab:
            matlab.send('{"op": "advertise", "topic": "/garry/data", "type": "garry_ros/UserData"}')
            matlab.send('{"op": "publish", "topic": "/garry/data", "msg": {"a2": 2, "goal": 3}}')
            wait_until(lambda: ("/garry/data", {"a2": 2.0, "goal": 3.0}) in heard)
        assert originals.problem == ""
    good = [said for topic, said in heard if topic == "/garry/good_step"]
    assert {"data": True} in good
    wait_until(lambda: heard[-1] == ("/garry/good_step", {"data": False}))
    data = next(said for topic, said in heard if topic == "/garry/data")
    assert data == {"a2": pytest.approx(0.93), "goal": pytest.approx(1.1)}
    assert json.dumps(data) != json.dumps({"a2": 0.93, "goal": 1.1})  # ROS has rounded to 32 bits


def _tell(originals, heard, topic):
    """Tell an event; nodes that have just met may lose it."""
    originals.allow(True)
    if topic == "/garry/data":
        originals.handle_message({"type": "step", "shown": 0.93, "goal": 1.1})
    else:
        originals.publish_decision(True, 5.0)
    time.sleep(0.1)
    return any(name == topic for name, _ in heard)
