"""A Stretch and a Quori by fakes of their own interfaces: sessions, stops and what goes wrong."""

from dataclasses import replace

import pytest

from robot.bases.rosbridge.joints import FASTEST_RAD_S, LONGEST_S, Joints
from robot.bases.rosbridge.topics import PROFILES
from robot.motion.gestures import BUILT_IN, GESTURES, ORIGINALS
from robot.motion.limits import TICK_S
from robot.play_gesture import play_gesture
from robot.wire.cue_limits import VARIED
from tests.support.fake_quori import ORDER
from tests.support.robot_stage import CUE
from tests.support.ros_robots import NAMES, TOPICS, RobotStage

each_robot = pytest.mark.parametrize("name", NAMES)
STRETCH = PROFILES["stretch"].joint_server
QUICK = {*GESTURES, *ORIGINALS, "near_miss_3", "effort_1", "greeting_9"}  # the others: `long`
# Looks aside: a goal that its driver does not take for reached at once.
ASIDE = Joints(STRETCH, ("joint_head_pan",), (0.0,), (0.8,), (-0.8,))


def goals(stage):
    return [one["op"] for one in stage.bridge.said if one["op"].endswith("action_goal")]


@each_robot
@pytest.mark.parametrize("minutes", [0.5, pytest.param(10, marks=pytest.mark.long)])
def test_each_gesture_of_a_session_ends_at_home(name, minutes):
    stage = RobotStage(name)
    stage.perform(CUE | {"above": VARIED, "below": VARIED, "seed": 1})
    ended = stage.walk(round(60 * minutes))
    assert {outcome for outcome, _, _ in ended} == {"done"}
    assert len(ended) >= 8 * minutes
    assert max(away_m for _, away_m, _ in ended) < 0.02
    assert max(turned_deg for _, _, turned_deg in ended) < 2
    assert any(away_m for _, away_m, _ in ended)  # some of them drive
    assert not stage.bridge.log
    assert not stage.base_client.problem(stage.now_s)


@each_robot
@pytest.mark.parametrize(
    "gesture", [pytest.param(g, marks=[pytest.mark.long] * (g not in QUICK)) for g in BUILT_IN]
)
def test_every_gesture_ends_at_home(name, gesture):
    stage = RobotStage(name)
    played = play_gesture(BUILT_IN[gesture], stage.base, lambda: stage.now_s, stage.sleep)
    away_m, turned_deg = stage.robot.body.away()
    assert played["outcome"] == "done"
    assert away_m < 0.02
    assert turned_deg < 2


def test_what_a_quori_is_beside_home_it_corrects_without_a_turn():
    stage = RobotStage("quori").perform(CUE | {"above": "nod"})  # straight ahead and back
    stage.wait(6)
    assert max(abs(order[3]) for order in stage.robot.orders) < 0.02
    stage.robot.push_aside(0.03)
    assert stage.robot.body.away()[0] > 0.025
    ended, *_ = stage.walk(12, [1.2])
    assert max(abs(order[3]) for order in stage.robot.orders) > 0.04
    outcome, away_m, turned_deg = ended
    assert outcome == "done"
    assert away_m < 0.01
    assert turned_deg < 2


# --- stops --------------------------------------------------------------------------------------


@each_robot
@pytest.mark.parametrize("later_s", [0.0, 0.1, 0.24, 0.5])
def test_a_stop_stills_wheels_and_joints(name, later_s):
    stage = RobotStage(name).begin_answer()
    stage.wait(later_s)
    stage.performer.handle({"type": "stop"}, stage.now_s)
    assert stage.until_still() <= 0.75
    told, held = len(goals(stage)), stage.robot.angles()
    stage.performer.handle({"type": "arm"}, stage.now_s)
    stage.wait(2.0)
    assert (len(goals(stage)), stage.robot.angles()) == (told, held)  # an arming moves nothing


@pytest.mark.parametrize("later_s", [0.0, 0.1, 0.24, 0.5])
def test_a_stop_cancels_a_running_goal_and_holds_what_goes_on(later_s):
    stage = RobotStage("stretch", joints=ASIDE).begin_answer()
    stage.wait(later_s)
    stage.performer.handle({"type": "stop"}, stage.now_s)
    assert stage.until_still() <= 0.75
    assert goals(stage) == ["send_action_goal", "cancel_action_goal", "send_action_goal"]
    assert abs(stage.robot.angles()["joint_head_pan"]) < 0.55  # on its way to 0.8
    assert not stage.base.counters["goals_refused"]


def test_a_stop_on_the_way_back_to_rest_holds_it_too():
    stage = RobotStage("stretch").begin_answer()
    while stage.performer.body.player.is_busy:
        stage.wait(TICK_S)
    stage.wait(0.3)
    assert stage.robot.are_joints_moving
    stage.performer.handle({"type": "stop"}, stage.now_s)
    assert stage.until_still() <= 0.75


def test_a_hold_that_is_rejected_is_sent_again():
    stage = RobotStage("stretch", joints=ASIDE).begin_answer()
    stage.robot.rejects = True
    stage.performer.handle({"type": "stop"}, stage.now_s)
    stage.wait(0.3)
    assert "rejected" in stage.base_client.problem(stage.now_s)
    stage.robot.rejects = False
    assert stage.until_still() <= 0.6
    assert not stage.base_client.problem(stage.now_s)


def test_a_pause_holds_the_joints_and_the_end_of_the_program_does():
    stage = RobotStage("stretch", joints=ASIDE).begin_answer()
    stage.performer.handle({"type": "state", "state": "paused"}, stage.now_s)
    assert stage.until_still() <= 1.0  # wheels come home to rest by a ramp
    stage = RobotStage("stretch", joints=ASIDE).begin_answer()
    stage.base.stop()
    stage.close()
    assert stage.until_still() <= 0.75


@each_robot
def test_no_joint_is_faster_than_a_reduced_speed(name):
    stage = RobotStage(name).begin_answer()
    stage.wait(8)
    assert 0.2 < stage.robot.fastest_rad_s <= FASTEST_RAD_S + 1e-6


def test_a_stretch_s_driver_takes_the_velocity_0_for_no_limit():
    rest = replace(STRETCH, end_rad_s=0.0)  # as a controller of ros2_controllers wants it
    joints = replace(PROFILES["stretch"].joints, server=rest)
    stage = RobotStage("stretch", joints=joints).begin_answer()
    stage.wait(2)
    assert stage.robot.fastest_rad_s > 1.0


# --- what goes wrong ----------------------------------------------------------------------------


@pytest.mark.parametrize("is_old", [False, True], ids=["new bridge", "old bridge"])
@pytest.mark.parametrize("fault", ["rejects", "no server"])
def test_a_goal_that_is_not_accepted_is_told_and_the_gesture_ends_at_home(is_old, fault):
    stage = RobotStage("stretch")
    stage.bridge.is_old = is_old
    if fault == "rejects":
        stage.robot.rejects = True
    else:
        stage.bridge.graph.actions.clear()
    stage.perform(CUE).wait(8)
    assert [one["outcome"] for one in stage.told if one.get("outcome")] == ["done"]
    assert stage.robot.body.away()[0] < 0.02
    assert stage.base.counters["goals_refused"] >= 1
    told = {"rejects": "was rejected", "no server": "No action server"}[fault]
    problem = stage.base_client.problem(stage.now_s)
    assert ("no end of a goal" if is_old else told) in problem
    assert "Head or arms do not act" in problem


def test_a_run_stop_stops_and_latches_until_a_person_arms_it():
    stage = RobotStage("stretch").begin_answer()
    stage.robot.press_run_stop(True)
    assert stage.until_still() <= 0.75
    assert [one["reason"] for one in stage.told if one["kind"] == "stop"] == ["button"]
    stage.performer.handle({"type": "arm"}, stage.now_s)
    assert stage.performer.body.safety.latch == "button"  # it is pressed still
    stage.robot.press_run_stop(False)
    stage.wait(1.0)
    assert not stage.robot.is_moving
    assert not stage.robot.are_joints_moving
    stage.performer.handle({"type": "arm"}, stage.now_s)
    assert stage.performer.body.safety.latch == ""


def test_a_stretch_that_is_not_in_navigation_mode_is_refused():
    stage = RobotStage("stretch")
    stage.robot.switch("position")
    stage.wait(0.2)
    assert stage.base.read().sensors.refusal == "wrong_mode"
    assert "bring it to 'navigation' mode" in stage.base_client.problem(stage.now_s)
    stage.robot.switch("navigation")
    stage.wait(0.2)
    stage.begin_answer()
    stage.robot.switch("position")  # by another program
    assert stage.until_still() <= 0.75
    assert [one["reason"] for one in stage.told if one["kind"] == "stop"] == ["wrong_mode"]


def test_a_stretch_at_its_charger_begins_nothing():
    stage = RobotStage("stretch")
    stage.robot.is_charging = True
    stage.wait(0.2)
    assert stage.base.read().sensors.is_charging
    assert stage.base.read().sensors.battery_v is None  # of another kind than a Kobuki's


@each_robot
def test_a_connection_that_is_lost_ends_in_standing_still_and_is_not_resumed(name):
    stage = RobotStage(name).begin_answer()
    stage.lose()
    began_s = moved_s = turned_s = stage.now_s
    for _ in range(round(4 / TICK_S)):
        stage.wait(TICK_S)
        moved_s = stage.now_s if stage.robot.is_moving else moved_s
        turned_s = stage.now_s if stage.robot.are_joints_moving else turned_s
    assert moved_s - began_s <= 1.0  # by the timeout of its driver
    assert turned_s - began_s <= LONGEST_S
    assert stage.performer.body.safety.latch == "base_silent"
    stage.connect()
    stage.wait(3.0)
    assert not stage.robot.is_moving
    assert not stage.robot.are_joints_moving


def test_a_turret_that_is_not_told_stops_a_quori():
    stage = RobotStage("quori").begin_answer()
    stage.robot.is_turret_mute = True
    assert stage.until_still() <= 0.2 + 0.2 + 0.75  # its angle grows old, then its odometry
    assert [one["reason"] for one in stage.told if one["kind"] == "stop"] == ["base_silent"]


def test_a_quori_that_hears_two_programs_does_not_move_and_says_so():
    stage = RobotStage("quori")
    stage.bridge.graph.advertise(ORDER, "geometry_msgs/Twist", "/joystick")
    stage.perform().wait(3)
    assert not stage.robot.is_moving
    assert [one["reason"] for one in stage.told if one["kind"] == "stop"] == ["stalled"]


def test_arms_that_are_named_by_halves_would_not_move():
    joints = TOPICS["quori"].joints
    half = Joints(joints.server, joints.names[:4], *((0.0,) * 4, (0.5,) * 4, (0.2,) * 4))
    stage = RobotStage("quori", joints=half).perform()
    stage.wait(3)
    assert not any(stage.robot.angles().values())
