"""A robot is driven to its mark by a held button, and by nothing else."""

import pytest

from robot.behavior.manual_drive import HOLDS_S, SPEED_M_S
from robot.motion.pose import HOME
from tests.support.robot_stage import WELCOME, FeelingBase, Stage

AHEAD = {"type": "drive", "ahead": 1, "left": 0}


def placed():
    """Return a stage with an armed real base, whose session does not run."""
    stage = Stage(FeelingBase)
    stage.hear(**WELCOME | {"state": "paused"})
    stage.hear(type="arm")
    stage.wait(0.1)
    return stage


def hold(stage, for_s, message=AHEAD):
    """Hold the button: an order every 0.1 s; return how far it went [m]."""
    before = stage.base.ground_truth().pose
    for _ in range(round(for_s / 0.1)):
        stage.hear(**message)
        stage.wait(0.1)
    return stage.base.ground_truth().pose.distance_m(before)


def test_it_goes_while_the_button_is_held_and_stands_soon_after():
    stage = placed()
    stage.base.set_home = lambda: None  # a simulated one would be put back
    way_m = hold(stage, 1.0)
    assert way_m == pytest.approx(SPEED_M_S, abs=0.02)
    before = stage.base.ground_truth().pose
    stage.wait(HOLDS_S + 0.1)
    assert stage.base.read().twist.is_still
    assert stage.base.ground_truth().pose.distance_m(before) <= SPEED_M_S * (HOLDS_S + 0.03)


def test_where_it_stands_is_home():
    stage, homes = placed(), []
    stage.base.set_home = lambda: homes.append(stage.now_s)
    hold(stage, 0.2)
    assert homes
    assert homes[-1] <= stage.now_s


def test_it_turns_and_never_backs_up():
    stage = placed()
    stage.base.set_home = lambda: None
    hold(stage, 0.4, AHEAD | {"ahead": 0, "left": 1})
    assert stage.base.ground_truth().pose.heading_rad > 0.1
    bad = stage.robot.bad_messages
    before = stage.base.ground_truth().pose
    hold(stage, 0.4, AHEAD | {"ahead": -1})
    assert stage.base.ground_truth().pose.distance_m(before) < 0.02  # the last turn's end
    assert stage.robot.bad_messages > bad


@pytest.mark.parametrize("why", ["running", "stopped", "disarmed", "unwatched", "bump"])
def test_nothing_moves_it_where_it_may_not(why):
    stage = placed()
    stage.base.set_home = lambda: None
    if why == "running":
        stage.hear(type="state", state="running")
    elif why == "stopped":
        stage.hear(type="stop")
    elif why == "disarmed":
        stage.robot.body.safety.is_armed = False
    elif why == "unwatched":
        stage.hear(type="heartbeat", watched=False)
    else:
        stage.base.sensors = type(stage.base.sensors)(hazards=frozenset({"bump"}))
    assert hold(stage, 0.5) == 0


@pytest.mark.parametrize("how", ["stop", "start", "silence"])
def test_it_ends_at_once(how):
    stage = placed()
    stage.base.set_home = lambda: None
    hold(stage, 0.3)
    if how == "stop":
        stage.hear(type="stop")
    elif how == "start":
        stage.hear(type="state", state="running")
    else:
        stage.heartbeats = False
    stage.wait(0.02 if how != "silence" else HOLDS_S + 0.02)
    assert stage.base.read().twist.is_still
    assert stage.base.ground_truth().pose != HOME


def test_an_order_that_waited_while_it_hung_moves_nothing():
    stage = placed()
    stage.base.set_home = lambda: None
    before = stage.base.ground_truth().pose
    stage.now_s += 1
    stage.hear(**AHEAD)
    stage.wait(HOLDS_S)
    assert stage.base.ground_truth().pose == before
    assert hold(stage, 0.5) > 0
