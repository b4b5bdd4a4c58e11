"""The base that ROS drives and the original's topics, with nodes of rospy behind the bridge."""

import json
import math
import time
from contextlib import ExitStack
from dataclasses import replace

import pytest
from websockets.sync.client import connect

from robot.bases.rosbridge import RosbridgeBase
from robot.bases.rosbridge.topics import PROFILES, Topics
from robot.motion.gestures import GESTURES
from robot.motion.twist import STILL, Twist
from robot.original_topics import OriginalTopics
from robot.play_gesture import play_gesture
from robot.ros.frames import Topic
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
from tests.support.wire import Wire

pytestmark = [pytest.mark.ros, pytest.mark.realtime]

PLAIN = replace(PROFILES["plain"], own_timeout_s=0.6)
BUMPER = Topic("/bumper", "std_msgs/Bool")


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


def open_base(url):
    base = RosbridgeBase(
        time.monotonic, Topics(PLAIN.order, PLAIN.odometry, {"bump": BUMPER}, own_timeout_s=0.6)
    )
    base.port = url
    return base


def test_a_node_of_rospy_receives_twists_and_its_odometry_closes_the_loop(ros):
    start = ros.robot.x_m, ros.robot.y_m
    with open_base(ros.url) as base:
        release(base)
        played = play_gesture(GESTURES["celebrate"], base, time.monotonic, time.sleep)
    assert played["outcome"] == "done"
    assert 0.02 < played["farthest_m"] < 0.1
    assert math.dist(start, (ros.robot.x_m, ros.robot.y_m)) < 0.02
    assert any(order[1] > 0 for order in ros.robot.orders)
    wait_until(lambda: ros.robot.orders[-1][1:] == (0.0, 0.0))
    assert not ros.bridge.log


def test_a_bumper_of_a_node_stops_it(ros):
    with open_base(ros.url) as base:
        release(base)
        drive(base, Twist(0.1, 0), lambda: ros.robot.is_moving)
        ros.node.publish(BUMPER.name, {"data": True})
        drive(base, Twist(0.1, 0), lambda: "bump" in base.read().sensors.hazards)
        ros.node.publish(BUMPER.name, {"data": False})
        drive(base, STILL, lambda: not base.read().sensors.hazards)


def test_a_reconnection_replays_nothing(ros):
    with ExitStack() as stack:
        wire = stack.enter_context(Wire(ros.port))
        base = stack.enter_context(open_base(f"ws://127.0.0.1:{wire.port}"))
        release(base)
        drive(base, Twist(0.2, 0), lambda: ros.robot.is_moving)
        wire.go_down()
        drive(base, Twist(0.2, 0), lambda: "No rosbridge" in base.problem)
        wait_until(lambda: not ros.robot.is_moving)  # by its own timeout: nobody else can
        before = len(ros.robot.orders)
        wire.come_up()
        drive(base, Twist(0.2, 0), lambda: len(ros.robot.orders) > before + 3)
        assert {order[1:] for order in ros.robot.orders[before:]} == {(0.0, 0.0)}


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
    if topic == "/garry/data":
        originals.handle_message({"type": "step", "shown": 0.93, "goal": 1.1})
    else:
        originals.publish_decision(True, 5.0)
    time.sleep(0.1)
    return any(name == topic for name, _ in heard)
