"""Frames of rosbridge by hand-built JSON, and that whatever else comes is refused."""

import json
import math
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from hypothesis import given

from robot.motion.pose import Pose
from robot.motion.twist import Twist
from robot.ros.frames import (
    ActionResult,
    BadRosFrame,
    Publication,
    ServiceResponse,
    Topic,
    advertise,
    call_service,
    cancel_goal,
    publish,
    read_frame,
    send_goal,
    subscribe,
    to_text,
    unadvertise,
    unsubscribe,
)
from robot.ros.messages import (
    EVENTS,
    read_event,
    read_hazards,
    read_joints,
    read_odometry,
    read_stamp_s,
    read_twist,
    write_twist,
)
from tests.support.json_values import ANYTHING

CMD = Topic("/cmd_vel", "geometry_msgs/Twist")


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (
            advertise(CMD),
            '{"op":"advertise","topic":"/cmd_vel","type":"geometry_msgs/Twist",'
            '"latch":false,"queue_size":1}',
        ),
        (
            publish(CMD, write_twist(Twist(0.2, -1.5, 0.1))),
            '{"op":"publish","topic":"/cmd_vel","msg":'
            '{"linear":{"x":0.2,"y":0.1,"z":0.0},"angular":{"x":0.0,"y":0.0,"z":-1.5}}}',
        ),
        (unadvertise(CMD), '{"op":"unadvertise","topic":"/cmd_vel"}'),
        (
            subscribe(CMD),
            '{"op":"subscribe","topic":"/cmd_vel","type":"geometry_msgs/Twist",'
            '"id":"/cmd_vel","throttle_rate":0,"queue_length":0}',
        ),
        (
            subscribe(Topic("/odom", "nav_msgs/Odometry"), newest_every_ms=20),
            '{"op":"subscribe","topic":"/odom","type":"nav_msgs/Odometry",'
            '"id":"/odom","throttle_rate":20,"queue_length":1}',
        ),
        (unsubscribe(CMD), '{"op":"unsubscribe","topic":"/cmd_vel","id":"/cmd_vel"}'),
        (
            call_service("/rosapi/subscribers", {"topic": "/cmd_vel"}, "who"),
            '{"op":"call_service","service":"/rosapi/subscribers",'
            '"args":{"topic":"/cmd_vel"},"id":"who"}',
        ),
    ],
    ids=[
        "advertise",
        "publish",
        "unadvertise",
        "all of it",
        "newest",
        "unsubscribe",
        "call_service",
    ],
)
def test_what_is_said(frame, text):
    assert to_text(frame) == text


def test_no_number_is_said_that_json_has_not():
    with pytest.raises(ValueError, match="JSON"):
        to_text(publish(CMD, write_twist(Twist(math.nan, 0))))


@pytest.mark.parametrize(
    ("text", "heard"),
    [
        (
            '{"topic": "/garry/good_step", "msg": {"data": true}, "op": "publish"}',
            Publication("/garry/good_step", {"data": True}),
        ),
        (
            '{"values": {"subscribers": ["/a"]}, "result": true, "id": "who", '
            '"service": "/rosapi/subscribers", "op": "service_response"}',
            ServiceResponse("who", {"subscribers": ["/a"]}),
        ),
        (
            '{"values": "Service does not exist", "result": false, "id": "who", '
            '"service": "/x", "op": "service_response"}',
            ServiceResponse("who", None),
        ),
    ],
    ids=["publish", "answer", "failure"],
)
def test_what_is_heard(text, heard):
    assert read_frame(text) == heard


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "7", "NaN", "null", "[]", "{}", "\x00", '{"op":"publish"}', "[" * 100_000),
        '{"op":"publish","topic":7,"msg":{}}',
        '{"op":"publish","topic":"/cmd_vel","msg":[]}',
        '{"op":"status","level":"error","msg":"no"}',
        '{"op":["publish"],"topic":"/cmd_vel","msg":{}}',
        b"\xff\xfe",
    ],
    ids=range(15),
)
def test_what_is_no_frame(text):
    with pytest.raises(BadRosFrame):
        read_frame(text)


def odometry(x=1.0, y=2.0, heading_rad=0.5, v=0.1, w=-0.2):
    half = heading_rad / 2
    turned = {"x": 0, "y": 0, "z": math.sin(half), "w": math.cos(half)}
    pose = {"position": {"x": x, "y": y, "z": 0}, "orientation": turned}
    twist = {"linear": {"x": v, "y": 0.05}, "angular": {"z": w}}
    return {"pose": {"pose": pose}, "twist": {"twist": twist}}


def test_an_odometry_is_read():
    pose, twist = read_odometry(odometry())
    assert (pose.x_m, pose.y_m, twist) == (1.0, 2.0, Twist(0.1, -0.2, 0.05))
    assert pose.heading_rad == pytest.approx(0.5)
    assert isinstance(pose, Pose)


@pytest.mark.parametrize(
    "message",
    [
        odometry(x=math.nan),
        odometry(y=math.inf),
        odometry(x=1e300),
        odometry(x=10**400),
        odometry(x="1"),
        odometry(x=True),
        odometry(x=None),
        odometry(v=math.nan),
        odometry(w=1e9),
        odometry() | {"twist": {}},
        odometry() | {"pose": {"pose": {"position": {"x": 0, "y": 0}, "orientation": {}}}},
    ],
    ids=range(11),
)
def test_an_odometry_that_cannot_be(message):
    with pytest.raises(BadRosFrame):
        read_odometry(message)


def test_an_orientation_of_length_0_is_none():
    message = odometry()
    message["pose"]["pose"]["orientation"] = dict.fromkeys("xyzw", 0.0)
    with pytest.raises(BadRosFrame, match="quaternion"):
        read_odometry(message)


@given(ANYTHING)
def test_no_message_does_more_than_be_refused(message):
    readers: list[Any] = [read_twist, read_odometry, read_hazards, read_joints, read_stamp_s]
    readers += [partial(read_event, kind) for kind in EVENTS]
    for read in readers:
        with suppress(BadRosFrame):
            read(message if isinstance(message, dict) else {"twist": message, "pose": message})
    with suppress(BadRosFrame):
        read_frame(json.dumps(message))


ACTION = Topic("/head/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory")


def test_a_goal_is_sent_and_canceled():
    assert json.loads(to_text(send_goal(ACTION, {"trajectory": {}}, "garry_1"))) == {
        "op": "send_action_goal",
        "action": ACTION.name,
        "action_type": ACTION.kind,
        "args": {"trajectory": {}},
        "feedback": False,
        "id": "garry_1",
    }
    assert cancel_goal(ACTION, "garry_1") == {
        "op": "cancel_action_goal",
        "action": ACTION.name,
        "id": "garry_1",
    }


@pytest.mark.parametrize(
    ("told", "problem"),
    [
        ({"values": {"error_string": "there"}, "status": 4, "result": True}, ""),
        ({"values": {"status": 4, "result": {}}, "result": True}, ""),  # of early 2024
        ({"values": {"error_string": "no"}, "status": 6, "result": True}, "no"),
        ({"values": {}, "status": 5, "result": True}, "it ended with the status 5"),
        ({"values": {}, "result": True}, "it ended with the status None"),
        ({"values": "Action goal was rejected", "status": 0, "result": False}, "rejected"),
        ({"values": None}, "refused"),
    ],
)
def test_the_end_of_a_goal_says_why_it_was_not_reached(told, problem):
    frame = {"op": "action_result", "action": ACTION.name, "id": "garry_1"}
    result = read_frame(json.dumps(frame | told))
    assert isinstance(result, ActionResult)
    assert (result.goal_id, problem in result.problem) == ("garry_1", True)
    assert bool(result.problem) == bool(problem)
