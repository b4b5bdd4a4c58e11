"""A simulated robot in a demo: nobody finds it stopped, unless somebody has stopped it."""

from __future__ import annotations

import random

import pytest

from robot.bases.kinematic import KinematicBase
from robot.behavior.safety import REARM_AFTER_S
from tests.support.robot_stage import WELCOME, RealBase, Stage
from tests.support.twin_bench import needs_physics
from tests.support.wired_twin import WiredTwin

STRIDE_S = 1.1


def begin(make):
    stage = Stage(make)
    stage.hear(**WELCOME)
    return stage


def begin_gesture(make):
    stage = begin(make)
    stage.walk(*[1.0] * 6)
    stage.wait(0.4)
    assert stage.robot.body.player.is_busy
    assert not stage.base.read().twist.is_still
    return stage


def walk(stage, minutes):
    """Walk as simulated patients do: some six of ten strides at the goal, strong and weak ones."""
    chance = random.Random(3)
    strides = round(60 * minutes / STRIDE_S)
    mean = [1.0 + 0.2 * chance.uniform(-1, 1) for _ in range(strides // 30 + 1)]
    values = [mean[number // 30] + chance.gauss(0.0, 0.06) for number in range(strides)]
    stage.walk(*values, every_s=STRIDE_S)


def stop_reasons(stage):
    return [report["reason"] for report in stage.of("stop")]


@pytest.mark.wide
@pytest.mark.parametrize(
    ("make", "minutes"),
    [
        (KinematicBase, 5),
        (WiredTwin, 2),
        pytest.param(KinematicBase, 60, marks=pytest.mark.long),
        pytest.param(WiredTwin, 20, marks=pytest.mark.long),
    ],
)
def test_it_plays_for_minutes_and_never_stops_itself(make, minutes):
    stage = begin(make)
    walk(stage, minutes)
    stage.wait(10)
    assert stop_reasons(stage) == []
    assert set(stage.ended) == {"done"}
    assert len(stage.ended) > 4 * minutes
    assert stage.state == ("idle", "")


def hang(stage):
    """As a laptop that was closed for a moment."""
    stage.now_s += 2.0
    stage.hear(type="heartbeat")


def hold(stage):
    """Something is in its way for a moment."""
    stage.base.do("set", name="held", value=1.0, for_s=2.0)


def push_over_the_edge(stage):
    stage.base.do("edge", ahead_m=0.15)


def bump_into_a_wall(stage):
    stage.base.do("wall", ahead_m=0.178)


@pytest.mark.parametrize(
    ("happens", "reasons", "body"),
    [
        (hang, {"order_lapsed", "base_silent", "unordered_motion"}, "kinematic"),
        (hold, {"stalled", "slipped"}, "kinematic"),
        pytest.param(push_over_the_edge, {"cliff", "wheel_drop"}, "bullet", marks=needs_physics),
        pytest.param(bump_into_a_wall, {"bump", "stalled"}, "bullet", marks=needs_physics),
    ],
)
def test_it_is_put_back_after_whatever_stopped_it(happens, reasons, body):
    stage = begin_gesture(lambda monotonic: WiredTwin(monotonic, body))
    happens(stage)
    before = len(stage.ended)
    stage.wait(6.0)
    assert set(stop_reasons(stage)) & reasons
    assert stage.state == ("idle", "")
    stage.source_s += 20.0
    stage.walk(*[1.2] * 12)
    assert "started" in [report["phase"] for report in stage.of("gesture")[before:]]


@pytest.mark.wide
def test_somebodys_stop_stays():
    stage = begin_gesture(KinematicBase)
    stage.hear(type="stop")
    walk(stage, 1)
    assert stage.state == ("stopped", "stopped")
    hung = begin_gesture(KinematicBase)
    hang(hung)
    hung.wait(0.2)
    hung.hear(type="stop")  # after it had stopped itself
    walk(hung, 1)
    assert hung.state[0] == "stopped"
    pressed = begin_gesture(lambda monotonic: WiredTwin(monotonic, "kinematic"))
    pressed.base.do("set", name="buttons", value=1, for_s=0.5)
    walk(pressed, 1)
    assert pressed.state == ("stopped", "button")


def test_a_real_base_waits_for_a_person():
    stage = begin(RealBase)
    stage.hear(type="arm")
    stage.perform()
    hang(stage)
    stage.wait(10 * REARM_AFTER_S)
    assert stage.state[0] == "stopped"
    assert stop_reasons(stage) == ["order_lapsed"]
