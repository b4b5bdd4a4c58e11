"""Gestures of a base that ROS drives, in a closed and in an open loop."""

import math

import pytest

from robot.behavior.safety import OPEN_LOOP_MAX_GESTURES
from robot.motion.gesture_variants import VARIANTS
from robot.motion.gestures import BUILT_IN, GESTURES, ORIGINALS
from robot.play_gesture import play_gesture
from tests.support.robot_stage import CUE
from tests.support.rosbridge_stage import OPEN, Stage, moving
from tests.support.variants import cases

pytestmark = pytest.mark.matrix


@pytest.mark.parametrize("name", cases(BUILT_IN))
@pytest.mark.parametrize("goes", [1.0, 0.93])
def test_every_gesture_of_a_base_just_opened_ends_at_home(name, goes):
    stage = Stage()
    stage.robot.goes = goes
    played = play_gesture(BUILT_IN[name], stage.base, lambda: stage.now_s, stage.sleep)
    assert played["outcome"] == "done"
    assert played["abilities"]["closed_loop"]
    x_m, y_m = stage.robot.x_m - 3.0, stage.robot.y_m + 2.0
    assert math.hypot(x_m, y_m) < 0.02
    assert abs(math.remainder(stage.robot.heading_rad - 3.0, math.tau)) < math.radians(2)


def test_a_session_s_gesture_in_a_closed_loop(stage):
    stage.perform().wait(8)
    assert [report["outcome"] for report in stage.of("gesture")] == ["", "done"]
    assert not any("open_loop" in report for report in stage.of("gesture"))
    status = stage.of("status")[-1]
    assert (status["open_loop"], status["bumpers"]) == (False, True)


@pytest.mark.parametrize("name", cases({**GESTURES} | VARIANTS))
def test_an_open_loop_is_short_timed_and_told(name):
    stage = Stage(OPEN)
    stage.robot.odometry = ""
    stage.perform(CUE | {"above": name}).wait(6)
    started, ended = stage.of("gesture")
    assert (ended["outcome"], ended["open_loop"], started["open_loop"]) == ("done", True, True)
    assert stage.of("decision")[0]["intensity"] == 0.5
    status = stage.of("status")[-1]
    assert (status["open_loop"], status["bumpers"]) == (True, False)
    # It follows its orders here, and so is home.
    assert math.hypot(stage.robot.x_m - 3.0, stage.robot.y_m + 2.0) < 0.02
    span_s = moving(stage)[-1][0] - moving(stage)[0][0]
    assert 0.5 < span_s < 4.0


@pytest.mark.parametrize("name", ORIGINALS)
def test_an_open_loop_refuses_what_is_long(name):
    stage = Stage(OPEN).perform(CUE | {"above": name})
    assert stage.of("decision")[0]["reason"] == "open_loop"
    stage.wait(1)
    assert not moving(stage)


def test_an_open_loop_has_to_be_looked_at_after_so_many_gestures():
    stage = Stage(OPEN).perform()
    told = [stage.performer.decision]
    for number in range(6, 5 * OPEN_LOOP_MAX_GESTURES + 6):
        stage.wait(1)
        step = {"type": "step", "time_s": float(number), "performance": 1.2}
        stage.performer.handle(step, stage.now_s)
        told += [stage.performer.decision] * (stage.performer.decision is not told[-1])
    assert len(told) == OPEN_LOOP_MAX_GESTURES + 1
    assert len(moving(stage)) > 0
    assert stage.of("decision")[-1]["reason"] == "place_unknown"
    assert stage.of("decision")[-2]["reason"] == ""
    stage.performer.handle({"type": "arm"}, stage.now_s)
    assert stage.performer.body.safety.blocking_reason(stage.base.read()) == ""
