"""What a base by ROS says, and how it holds its head or arms."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from robot.bases import Answer, BadOption
from robot.bases.rosbridge.joint_mover import HOLD
from robot.bases.rosbridge.joints import FASTEST_RAD_S, LONGEST_S, Joints, JointServer
from robot.bases.rosbridge.voice_and_joints import Voice
from robot.ros.frames import Topic
from tests.support.robot_stage import CUE
from tests.support.rosbridge_stage import CLOSED, Stage, base_of

SPEECH = Topic("/speech", "std_msgs/String")
HEAD = Topic("/head_controller/command", "trajectory_msgs/JointTrajectory")
VOICE = Voice(SPEECH, "Well done!", "Next time.")
JOINTS = Joints(JointServer(HEAD), ("pan", "tilt"), (0.0, 0.0), (0.0, -0.3), (0.2, 0.4))
REST = [0.0, 0.0]


class Figured(Stage):
    """A stage that keeps what its voice said, and where its joints were sent."""

    def __init__(self, voice=VOICE, joints=JOINTS):
        super().__init__(replace(CLOSED, voice=voice, joints=joints))
        self.said, self.sent = list[str](), list[dict[str, Any]]()
        graph = self.bridge.graph
        graph.subscribe(SPEECH.name, SPEECH.kind, lambda one: self.said.append(one["data"]))
        graph.subscribe(HEAD.name, HEAD.kind, self.sent.append)

    @property
    def poses(self):
        return [one["points"][0]["positions"] if one["points"] else [] for one in self.sent]


def test_it_answers_with_a_gesture_and_goes_back_to_rest():
    stage = Figured().perform()
    assert stage.base.abilities.answers
    stage.wait(0.1)
    assert (stage.said, stage.poses) == (["Well done!"], [[0.0, -0.3]])
    assert stage.sent[0]["joint_names"] == ["pan", "tilt"]
    stage.wait(6.0)
    assert stage.of("gesture")[-1]["outcome"] == "done"
    assert stage.poses == [[0.0, -0.3], REST]
    assert not stage.bridge.log


@pytest.mark.parametrize("intensity", [0.5, 0.1])
def test_gentle_is_smaller_and_quiet_is_silent(intensity):
    stage = Figured()
    strength = intensity * CUE["intensity"]
    stage.base.answer(Answer("droop", is_glad=False, is_quiet=True, strength=strength))
    stage.wait(0.1)
    assert stage.said == []
    assert stage.poses == [[pytest.approx(0.2 * strength), pytest.approx(0.4 * strength)]]


@pytest.mark.parametrize(
    "message",
    [{"type": "stop"}, {"type": "state", "state": "paused"}],
    ids=["stopped", "paused"],
)
def test_whatever_ends_it_before_its_end_holds_it_and_an_arming_moves_nothing(message):
    stage = Figured().perform()
    stage.wait(0.8)
    stage.performer.handle(message, stage.now_s)
    stage.wait(2.0)
    assert (stage.poses, stage.sent[-1]) == ([[0.0, -0.3], []], HOLD)
    stage.performer.handle({"type": "arm"}, stage.now_s)
    stage.performer.handle({"type": "state", "state": "running"}, stage.now_s)
    stage.wait(1.0)
    assert len(stage.sent) == 2


def test_a_lost_connection_replays_nothing_and_the_end_holds_it():
    stage = Figured()
    stage.base.answer(Answer("nod", is_glad=True))
    stage.wait(0.1)
    stage.lose()
    stage.base.answer(Answer("nod", is_glad=True))
    stage.connect()
    stage.wait(1.0)
    assert len(stage.sent) == len(stage.said) == 1
    stage.base.answer(Answer("nod", is_glad=True))
    stage.wait(0.1)
    ended = list(stage.base_client.end(stage.now_s))
    assert [one["msg"] for one in ended if one.get("topic") == HEAD.name and "msg" in one] == [HOLD]


def test_no_joint_is_too_fast_from_any_pose_to_any_other():
    poses = [JOINTS.rest_rad, JOINTS.glad_rad, JOINTS.sad_rad]
    turn_rad = max(
        abs(one - other)
        for before, after in pairwise([*poses, *poses])
        for one, other in zip(before, after, strict=True)
    )
    # The fastest of a cubic between two rests is 1.5 times its mean.
    assert 1.5 * turn_rad / JOINTS.takes_s <= FASTEST_RAD_S + 1e-9
    assert JOINTS.takes_s <= LONGEST_S
    time = JOINTS.write_trajectory(REST)["points"][0]["time_from_start"]
    assert time["secs"] + time["nsecs"] * 1e-9 == pytest.approx(JOINTS.takes_s)


HEAD_WORDS = [
    *("--joints-topic", HEAD.name, "--joints", "pan,tilt", "--pose-rest=0,0"),
    *("--pose-glad=0,-0.3", "--pose-sad=0.2,0.4"),
]


def test_voice_and_joints_are_chosen():
    words = ["--speech-topic", "/speech", "--say-glad", "Well done!", "--say-sad", "Next time."]
    base = base_of(*words, *HEAD_WORDS)
    assert (base._client.topics.voice, base._client.topics.joints) == (VOICE, JOINTS)
    assert not base_of().abilities.answers


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (["--joints", "pan tilt"], "--joints: name the joints"),
        (["--pose-glad=0"], "--pose-glad: write an angle"),
        (["--pose-sad=0,nan"], "--pose-sad: write an angle"),
        (["--pose-sad=0,1.4"], "Choose smaller angles"),
        (["--joints-topic", "/head:std_msgs/Float64"], "Known types: trajectory_msgs"),
    ],
)
def test_joints_that_cannot_be(words, cure):
    with pytest.raises(BadOption, match=cure):
        base_of(*HEAD_WORDS, *words)
