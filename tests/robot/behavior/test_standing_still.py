"""Where a robot may not move, no pool's variant moves it, whatever was chosen."""

import pytest

from robot.bases import SensorState
from robot.behavior.safety import BATTERY_EMPTY_V
from robot.motion.gesture_variants import POOLS
from robot.motion.twist import STILL
from robot.wire.cue_limits import VARIED
from tests.support.robot_stage import CUE, WELCOME, FeelingBase, Stage

CUES = {
    "off": {"intensity": 0},
    "explicit feedback": {"only_informs": True},
}
# What is done to an armed base in a running session, and why nothing answers then.
DEEDS = {
    "stopped": lambda stage: stage.hear(type="stop"),
    "bump": lambda stage: feel(stage, hazards=frozenset({"bump"})),
    "button": lambda stage: feel(stage, stop_pressed=True),
    "charging": lambda stage: feel(stage, is_charging=True),
    "battery_low": lambda stage: feel(stage, battery_v=BATTERY_EMPTY_V),
    "unwatched": lambda stage: stage.hear(type="heartbeat", watched=False),
    "paused": lambda stage: stage.hear(type="state", state="paused"),
    "no_link": lambda stage: stage.robot.disconnect("no_link"),
    "disarmed": lambda stage: None,
}


def feel(stage, **sensors):
    stage.base.sensors = SensorState(**sensors)
    stage.wait(0.04)


def begin(name, cue=None, *, arms=True):
    stage = Stage(FeelingBase)
    stage.hear(**WELCOME | {"cue": CUE | {"above": name, "below": name} | (cue or {})})
    if arms:
        stage.hear(type="arm")
    return stage


def walk(stage):
    """Walk strong and weak windows; return the twists that were ordered meanwhile."""
    ordered = []
    for performance in [1.2] * 6 + [0.3] * 6:
        stage.hear(type="step", time_s=stage.source_s, performance=performance)
        for _ in range(10):
            stage.wait(0.1)
            ordered.append(stage.robot.body.ordered)
        stage.source_s += 1.0
    return ordered


def assert_still(stage, ordered):
    assert set(ordered) == {STILL}
    assert not stage.of("gesture")
    assert stage.base.answered == []


@pytest.mark.parametrize("name", [VARIED, *POOLS])
@pytest.mark.parametrize("what", CUES)
@pytest.mark.matrix
def test_a_cue_under_which_nothing_moves(name, what):
    stage = begin(name, CUES[what])
    assert_still(stage, walk(stage))
    assert {one["reason"] for one in stage.of("decision")} == {
        {"off": "off", "explicit feedback": "only_informs"}[what]
    }
    assert not stage.robot.may_act


@pytest.mark.parametrize("name", [VARIED, *POOLS])
@pytest.mark.parametrize("why", DEEDS)
@pytest.mark.matrix
def test_a_base_that_may_not_move(name, why):
    stage = begin(name, arms=why != "disarmed")
    DEEDS[why](stage)
    assert not stage.robot.may_act
    assert_still(stage, walk(stage))


def test_it_does_move_where_it_may():
    stage = begin(VARIED)
    assert stage.robot.may_act
    assert set(walk(stage)) > {STILL}
    assert stage.base.answered
