"""Gestures that come with a cue: checked here again, and performed."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.behavior.performer import Performer
from robot.motion.composed_gestures import Move, to_data
from robot.motion.limits import DEFAULT_LIMITS
from robot.motion.pose import HOME
from tests.support.robot_stage import CUE, WELCOME, IdealBase, RealBase, Stage

WAVE = to_data("wave", [Move(turn_rad=0.6), Move(turn_rad=-1.2), Move(turn_rad=0.6)])
FAR = to_data("far", [Move(forward_m=0.4), Move(forward_m=-0.4)])


def test_a_composed_gesture_needs_no_new_robot(stage):
    stage.hear(type="cue", cue=CUE | {"above": "wave", "gestures": [WAVE]})
    stage.walk(*[1.1] * 6)
    stage.wait(5)
    assert stage.of("decision")[0]["gesture"] == "wave"
    assert [report["name"] for report in stage.of("gesture")] == ["wave", "wave"]
    assert stage.ended == ["done"]
    assert stage.base.read().pose.distance_m(HOME) < 0.01
    stage.hear(type="cue", cue=CUE | {"above": "wave"})  # it goes with its cue
    stage.walk(*[1.1] * 6)
    assert stage.of("decision")[-1]["reason"] == "unknown_gesture"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (FAR, "goes 0.40 m away"),
        (FAR | {"steps": 3}, "list of steps"),
        (WAVE | {"steps": [{"turn_rad": math.nan}]}, "not finite"),
        (WAVE | {"steps": [{"turn_rad": 1.0}]}, "It ends turned by 57°"),
    ],
)
@pytest.mark.parametrize("make", [IdealBase, RealBase])
def test_a_gesture_that_does_not_validate_here_moves_nothing(make, data, words):
    stage = Stage(make)
    name = data["name"]
    stage.hear(**WELCOME | {"cue": CUE | {"above": name, "gestures": [data]}})
    stage.hear(type="arm")
    stage.walk(*[1.2] * 6)
    decision = stage.of("decision")[0]
    assert (decision["gesture"], decision["reason"]) == (None, "bad_gesture")
    assert words in stage.robot.last_bad_message
    assert stage.robot.bad_messages == 1
    assert stage.base.read().pose == HOME
    assert stage.of("gesture") == []


@pytest.mark.parametrize("broken", [FAR, WAVE, {"steps": 3}])
def test_what_comes_under_a_built_in_name_does_not_take_the_gesture_away(stage, broken):
    stage.hear(type="cue", cue=CUE | {"gestures": [broken | {"name": "celebrate"}]})
    stage.walk(*[1.2] * 6)
    decision = stage.of("decision")[0]
    assert (decision["gesture"], decision["reason"]) == ("celebrate", "")
    assert "celebrate" in stage.robot.last_bad_message


def test_a_slower_robot_refuses_what_it_cannot_reach_in_time(stage):
    slow = Stage(IdealBase)
    slow.robot = Performer(slow.base, DEFAULT_LIMITS.scaled(0.1))
    slow.hear(**WELCOME | {"cue": CUE | {"above": "wave", "gestures": [WAVE]}})
    slow.walk(*[1.2] * 6)
    assert slow.of("decision")[0]["reason"] == "bad_gesture"
    assert "out_of_time" in slow.robot.last_bad_message


@settings(deadline=None)  # each walks six seconds
@given(st.lists(st.none() | st.integers() | st.text() | st.just({"name": [1]}), max_size=8))
def test_no_gesture_of_a_cue_can_crash_it(gestures):
    stage = Stage()
    stage.hear(**WELCOME | {"cue": CUE | {"above": "wave", "gestures": gestures}})
    stage.walk(*[1.2] * 6)
    assert stage.of("decision")[0]["reason"] == "unknown_gesture"


def test_gestures_are_a_short_list(stage):
    stage.hear(type="cue", cue=CUE | {"intensity": 0.3, "gestures": [WAVE] * 9})
    stage.hear(type="cue", cue=CUE | {"intensity": 0.3, "gestures": "wave"})
    assert stage.robot.bad_messages == 2
    assert stage.robot.decider.cue.intensity == 1


def test_a_gesture_that_nobody_knows(stage):
    stage.hear(type="cue", cue=CUE | {"above": "somersault"})
    stage.walk(*[1.0] * 6)
    assert stage.of("decision")[0]["reason"] == "unknown_gesture"
    assert stage.of("decision")[0]["gesture"] is None
