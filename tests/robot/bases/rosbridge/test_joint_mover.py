"""The goals of an action server, one at a time, whatever becomes of them."""

from dataclasses import replace

import pytest

from robot.bases.rosbridge.joint_mover import GOAL_EVERY_S, OVERDUE_S, TrajectoryAction
from robot.bases.rosbridge.joints import Joints, JointServer
from robot.ros.frames import ActionResult, Topic

ACTION = Topic("/arm/follow_joint_trajectory", "control_msgs/action/FollowJointTrajectory")
JOINTS = Joints(JointServer(ACTION), ("pan",), (0.0,), (0.5,), (-0.5,))
TOLD = replace(
    JOINTS, server=replace(JOINTS.server, states=Topic("/joint_states", "sensor_msgs/JointState"))
)


def send(mover, now_s, pose=(0.5,)):
    mover.move(list(pose))
    (frame,) = mover.due(now_s)
    return frame["id"]


def ops(mover, now_s):
    return [one["op"] for one in mover.due(now_s)]


def test_a_cancel_that_is_not_heard_is_sent_again_until_the_goal_has_ended():
    mover = TrajectoryAction(JOINTS)
    goal = send(mover, 0.0)
    mover.hold()
    told = [(round(n / 50, 2), op) for n in range(1, 41) for op in ops(mover, n / 50)]
    assert [op for _, op in told] == ["cancel_action_goal"] * len(told)
    assert len(told) == 4
    assert mover.is_holding
    mover.handle_result(ActionResult(goal, "it ended with the status 5"))
    assert ops(mover, 0.9) == []
    assert not mover.is_holding
    assert (mover.problem, mover.counters["goals_refused"]) == ("", 0)


def test_the_end_of_an_earlier_goal_says_nothing():
    mover = TrajectoryAction(JOINTS)
    first = send(mover, 0.0)
    second = send(mover, GOAL_EVERY_S + 0.01)
    assert first != second
    mover.handle_result(ActionResult(first, "it was preempted"))
    assert mover.problem == ""
    mover.handle_result(ActionResult(second, "the arm is blocked"))
    assert (mover.problem, mover.counters["goals_refused"]) == ("the arm is blocked", 1)
    third = send(mover, 2.0)
    mover.handle_result(ActionResult(third))
    assert mover.problem == ""


def test_two_programs_at_one_bridge_do_not_share_an_id():
    assert send(TrajectoryAction(JOINTS), 0.0) != send(TrajectoryAction(JOINTS), 0.0)


def test_a_goal_without_an_end_is_given_up():
    mover = TrajectoryAction(JOINTS)
    send(mover, 0.0)
    assert ops(mover, JOINTS.takes_s + OVERDUE_S - 0.1) == []
    assert ops(mover, JOINTS.takes_s + OVERDUE_S + 0.1) == ["cancel_action_goal"]
    assert "no end of a goal of /arm/follow_joint_trajectory" in mover.problem


def test_joints_that_stand_are_not_held_anew():
    mover = TrajectoryAction(TOLD)
    mover.handle_states({"pan": 0.1})
    mover.hold()
    assert ops(mover, 5.0) == []
    goal = send(mover, 10.0)
    mover.handle_result(ActionResult(goal))
    mover.hold()
    assert ops(mover, 10.0 + 10) == []


@pytest.mark.parametrize("there", [{}, {"tilt": 0.2}])
def test_joints_that_are_nowhere_cannot_be_held_and_it_says_so(there):
    mover = TrajectoryAction(TOLD)
    mover.handle_states(there)
    goal = send(mover, 0.0)
    mover.handle_result(ActionResult(goal))
    mover.hold()
    assert ops(mover, 0.3) == []
    assert "nobody tells where its joints are" in mover.problem
