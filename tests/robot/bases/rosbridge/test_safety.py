"""What a base that ROS drives feels and refuses, and what stops it."""

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.bases.rosbridge.topics import PROFILES
from robot.motion.limits import TICK_S
from tests.support.extent import examples
from tests.support.json_values import ANYTHING
from tests.support.rosbridge_stage import BUMPER, CLOSED, CMD, OPEN, Stage, moving

# --- what it feels, and what stops it -----------------------------------------------------------


@pytest.mark.parametrize("topics", [CLOSED, OPEN], ids=["closed", "open"])
def test_a_link_that_is_lost_without_a_word_stops_it_on_our_side(topics):
    stage = Stage(topics).begin_moving()
    stage.is_frozen = True
    stage.wait(0.3)
    assert stage.of("stop") == [{"kind": "stop", "reason": "base_silent"}]
    stage.wait(0.5)
    assert not stage.robot.is_moving  # by its own timeout; ours does not reach it
    stage.is_frozen = False
    stage.wait(1.0)
    assert not stage.robot.is_moving
    assert stage.of("status")[-1]["state"] == "stopped"


def test_odometry_that_goes_stale_stops_it(stage):
    stage.begin_moving()
    stage.robot.is_mute = True
    stage.wait(0.24)
    assert not stage.robot.is_moving
    assert stage.of("stop")[0]["reason"] == "base_silent"
    stage.wait(1.0)
    assert "No nav_msgs/Odometry comes on /odom" in stage.base_client.problem(stage.now_s)


def test_odometry_that_does_not_move_stops_it(stage):
    stage.begin_moving()
    stage.robot.goes = 0.0
    stage.wait(1.0)
    assert stage.of("stop")[0]["reason"] == "stalled"
    assert not stage.robot.is_moving


def test_a_bump_stops_it_in_place_and_holds(stage):
    stage.begin_moving()
    stage.tell(BUMPER.name, {"data": True})
    stage.wait(0.04)
    assert not stage.robot.is_moving
    assert stage.of("stop")[0]["reason"] == "bump"
    stage.wait(1.0)
    stage.performer.handle({"type": "arm"}, stage.now_s)
    assert stage.performer.body.safety.latch == "bump"  # it is pressed still
    stage.tell(BUMPER.name, {"data": False})
    stage.wait(0.2)
    stage.performer.handle({"type": "arm"}, stage.now_s)
    assert stage.performer.body.safety.latch == ""


def test_a_kobuki_s_own_feelers():
    stage = Stage(replace(PROFILES["kobuki"], own_timeout_s=0.6))
    for hazard, field in (("bump", "bumper"), ("cliff", "sensor"), ("wheel_drop", "wheel")):
        topic = PROFILES["kobuki"].sensors[hazard].name
        stage.tell(topic, {field: 1, "state": 1})
        assert hazard in stage.base.read().sensors.hazards
        stage.tell(topic, {field: 0, "state": 0})  # another one
        stage.now_s += 1
        assert hazard in stage.base.read().sensors.hazards
        stage.tell(topic, {field: 1, "state": 0})
        stage.now_s += 1
        assert hazard not in stage.base.read().sensors.hazards


def test_a_bump_that_ended_before_it_was_read_is_read_once(stage):
    stage.tell(BUMPER.name, {"data": True})
    stage.tell(BUMPER.name, {"data": False})
    assert "bump" in stage.base.read().sensors.hazards
    assert "bump" not in stage.base.read().sensors.hazards


def test_odometry_that_jumps_stops_it(stage):
    stage.begin_moving()
    stage.robot.x_m += 2.0
    stage.wait(0.04)
    assert stage.of("stop")[0]["reason"] == "restarted"


def test_another_program_that_drives_it_stops_it(stage):
    stage.begin_moving()
    stage.bridge.graph.publish(CMD.name, {"linear": {"x": 0.3, "y": 0.0}, "angular": {"z": 0.0}})
    stage.wait(0.04)
    assert stage.of("stop")[0]["reason"] == "other_driver"
    assert stage.base.counters["foreign"] == 1


def test_another_program_that_holds_it_still_is_welcome(stage):
    stage.begin_moving()
    stage.bridge.graph.publish(CMD.name, {"linear": {"x": 0.0, "y": 0.0}, "angular": {"z": 0.0}})
    stage.wait(0.04)
    assert not stage.of("stop")


messages = st.one_of(
    ANYTHING,
    st.fixed_dictionaries({"data": ANYTHING}),
    st.fixed_dictionaries({"linear": ANYTHING, "angular": ANYTHING}),
    st.fixed_dictionaries(
        {
            "linear": st.fixed_dictionaries({"x": ANYTHING, "y": ANYTHING}),
            "angular": st.fixed_dictionaries({"z": ANYTHING}),
        }
    ),
    st.fixed_dictionaries(
        {"pose": st.fixed_dictionaries({"pose": ANYTHING}), "twist": ANYTHING | st.none()}
    ),
)
frames = st.one_of(
    ANYTHING,
    st.fixed_dictionaries(
        {"op": st.just("publish"), "topic": st.sampled_from(["/cmd_vel", "/odom", "/bumper", "/x"])}
        | {"msg": messages}
    ),
    st.fixed_dictionaries(
        {"op": st.just("service_response"), "id": st.sampled_from(["/cmd_vel", "/bumper", ""])}
        | {"values": ANYTHING, "result": st.booleans()}
    ),
)


@settings(max_examples=examples(200))
@given(st.lists(frames, max_size=5))
@pytest.mark.long
def test_no_frame_of_a_bridge_moves_it_or_ends_it(said):
    stage = Stage()
    for frame in said:
        stage.inbox.append(json.dumps(frame))
        stage.wait(TICK_S)
    assert not moving(stage)
    assert stage.base.read().pose.is_finite


# --- what it refuses ----------------------------------------------------------------------------


def test_a_driver_that_is_not_there_is_told():
    stage = Stage()
    stage.bridge.graph.hearers[CMD.name].pop(0)
    stage.wait(2.5)
    assert stage.base.read().sensors.refusal == "nobody_listens"
    assert "No driver listens on /cmd_vel" in stage.base_client.problem(stage.now_s)
    stage.bridge.graph.subscribe(CMD.name, CMD.kind, stage.robot.follow)
    stage.wait(2.5)
    assert stage.base.read().sensors.refusal == ""


def test_a_bumper_that_was_promised_and_is_not_there_is_told(stage):
    stage.bridge.graph.publishers[BUMPER.name].clear()
    stage.wait(2.5)
    assert stage.base.read().sensors.refusal == "feeler_missing"
    assert "/bumper" in stage.base_client.problem(stage.now_s)


def test_without_rosapi_nobody_knows_and_it_moves():
    stage = Stage(has_rosapi=False).begin_moving()
    assert stage.base.read().sensors.refusal == ""


def test_what_does_not_come_back_is_told():
    stage = Stage()
    stage.lose()
    stage.bridge.graph.types[CMD.name] = "geometry_msgs/TwistStamped"
    stage.connect()
    stage.wait(1.5)
    assert stage.base.read().sensors.silent_s == math.inf
    assert "comes back" in stage.base_client.problem(stage.now_s)
    assert stage.bridge.log
