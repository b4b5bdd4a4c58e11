"""The relay that stands still for us where we are gone: by itself, and behind a rosbridge."""

import subprocess
import sys
from typing import Any

import pytest

from robot.bases.base import Indication
from robot.motion.twist import STILL, Twist
from tests.support.fake_ros import WATCHDOG, is_still_message, load_watchdog, twist_message
from tests.support.rosbridge_stage import WATCHED, Stage, moving

FORWARD, STAND = twist_message(0.2, 0.0), twist_message(0.0, 0.0)
HOLDS_S = load_watchdog().HOLDS_S


class Run:
    """A watchdog on a clock, and what it published, with when."""

    kind = "Watchdog"

    def __init__(self):
        self.now_s = 10.0
        self.sent: list[tuple[float, dict[str, Any]]] = []
        self.watchdog = getattr(load_watchdog(), self.kind)(
            lambda message: self.sent.append((round(self.now_s, 2), message)),
            lambda: STAND,
            is_still_message,
            self.now_s,
        )

    def wait(self, span_s, message=None):
        for _ in range(round(span_s / 0.02)):
            self.now_s += 0.02
            if message is not None:
                self.watchdog.receive(message, self.now_s)
            self.watchdog.check(self.now_s)
        return self


def test_it_passes_orders_on_and_stands_still_after_the_last_one():
    run = Run().wait(0.1, STAND).wait(0.5, FORWARD)
    last_s = run.now_s
    assert run.sent[-1] == (round(last_s, 2), FORWARD)
    run.wait(1.0)
    stops = [at_s - last_s for at_s, message in run.sent if message == STAND and at_s > last_s]
    assert len(stops) == 3
    assert HOLDS_S < stops[0] <= HOLDS_S + 0.03


def test_a_motion_that_was_interrupted_is_not_resumed():
    run = Run().wait(0.1, STAND).wait(0.1, FORWARD).wait(0.5)
    run.sent.clear()
    assert run.wait(1.0, FORWARD).sent == []
    run.wait(0.02, STAND).wait(0.02, FORWARD)
    assert [message for _, message in run.sent] == [STAND, FORWARD]


def test_it_begins_with_standing_and_ends_with_it():
    run = Run().wait(0.2, FORWARD)
    assert run.sent == []
    run.wait(0.02, STAND).wait(0.1, FORWARD)
    run.watchdog.end()
    assert [message for _, message in run.sent[-3:]] == [STAND] * 3


def test_after_a_hang_of_its_own_nothing_that_has_waited_is_passed_on():
    run = Run().wait(0.1, STAND).wait(0.1, FORWARD)
    run.sent.clear()
    run.now_s += 1.0
    run.watchdog.receive(FORWARD, run.now_s)
    assert [message for _, message in run.sent] == [STAND] * 3


def test_its_command_line_needs_no_ros():
    words = [sys.executable, str(WATCHDOG), "--help"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert "/garry/cmd_vel" in said


# --- a base that the relay watches ----------------------------------------------------------------


@pytest.fixture
def watched():
    return Stage(WATCHED)


def test_a_base_with_the_relay_moves_and_stops(watched):
    watched.wait(0.3)
    assert watched.base.read().sensors.refusal == ""
    watched.wait(0.3, Twist(0.2, 0))
    assert watched.robot.is_moving
    assert watched.base.read().sensors.silent_s < 0.1
    watched.wait(0.02, STILL)
    assert not watched.robot.is_moving
    assert not watched.base.read().sensors.hazards
    assert not watched.bridge.log


def test_a_base_that_nothing_watches_is_not_moved():
    stage = Stage(WATCHED)
    stage.relay.is_dead = True
    stage.wait(0.6)
    assert stage.base.read().sensors.refusal == "nobody_watches"
    stage.wait(1.0, Twist(0.2, 0))
    assert moving(stage) == []
    assert "garry_watchdog.py" in stage.base_client.problem(stage.now_s)


def test_a_relay_for_another_topic_does_not_count(watched):
    watched.relay.output = "/elsewhere"
    watched.wait(1.0)
    assert watched.base.read().sensors.refusal == "nobody_watches"


@pytest.mark.parametrize("fault", ["worker dies", "bridge dies"])
def test_a_base_without_a_timeout_stands_when_we_are_gone(watched, fault):
    watched.wait(0.4, Twist(0.2, 0))
    assert watched.robot.is_moving
    since_s = watched.now_s
    if fault == "bridge dies":
        watched.lose()
    else:
        watched.client.is_there = False
    while watched.robot.is_moving:
        watched.now_s += 0.02
        watched.relay.tell()
        assert watched.now_s - since_s < HOLDS_S + 0.05


def test_where_the_relay_dies_we_stop_the_base_past_it(watched):
    watched.begin_moving()
    since_s = watched.now_s
    watched.relay.is_dead = True
    while watched.robot.is_moving:
        watched.wait(0.02)
        assert watched.now_s - since_s < 0.35
    assert watched.performer.body.safety.latch in ("base_silent", "nobody_watches")


# --- what else a base by ROS does -----------------------------------------------------------------


def test_it_shows_nothing_where_it_has_no_lights(watched):
    watched.base.show(Indication.MOVING, aloud=True)
    watched.wait(0.1)
    assert not watched.base.abilities.announces
    assert not watched.bridge.log


# --- the gate of the original's nodes -------------------------------------------------------------

GATE = load_watchdog()
LEFT = twist_message(0.0, 1.8)


class GateRun(Run):
    """A gate on a clock, what GARRY says of late, and what it published."""

    kind = "Gate"

    def wait(self, span_s, message=None, may_act=None):
        """Let time pass; a message comes at its beginning, GARRY's word ten times a second."""
        if message is not None:
            self.watchdog.receive(message, self.now_s)
        for tick in range(round(span_s / 0.02)):
            self.now_s += 0.02
            if may_act is not None and tick % 5 == 0:
                self.watchdog.allow(may_act, self.now_s)
            self.watchdog.check(self.now_s)
        return self

    def moves(self):
        return [message for _, message in self.sent if message != STAND]

    def stands_after(self, since_s):
        """Return how long after a moment it first ordered to stand [s]."""
        return next(at_s for at_s, message in self.sent if message == STAND and at_s >= since_s) - (
            since_s
        )


def gate_in_a_gesture():
    """Return a gate with the first part of a gesture passed on."""
    run = GateRun().wait(3.0, may_act=True).wait(0.5, LEFT, may_act=True)
    assert run.moves() == [LEFT]
    return run


def test_the_gate_passes_each_order_once_while_a_robot_may_act():
    run = gate_in_a_gesture().wait(1.5, may_act=True).wait(2.0, FORWARD, may_act=True)
    assert run.moves() == [LEFT, FORWARD]
    assert not [at_s for at_s, message in run.sent if message == STAND and at_s > 13.0]


def test_it_begins_closed_and_says_so_to_the_base():
    run = GateRun().wait(1.0, LEFT)
    assert run.moves() == []
    assert {message["angular"]["z"] for _, message in run.sent} == {0.0}


@pytest.mark.parametrize(("word", "within_s"), [(False, 0.03), (None, GATE.FRESH_S + 0.03)])
def test_a_stop_and_silence_close_it(word, within_s):
    run = gate_in_a_gesture()
    since_s = run.now_s
    run.wait(1.0, may_act=word)
    assert run.stands_after(since_s) <= within_s
    stands = [at_s for at_s, message in run.sent if message == STAND and at_s >= since_s]
    assert 20 <= len(stands) / (run.now_s - stands[0]) <= 60  # zero Twists at 20 to 50 Hz


def test_the_rest_of_a_gesture_is_dropped_also_once_a_robot_may_act_again():
    run = gate_in_a_gesture().wait(0.2, may_act=False)
    for _ in range(3):
        run.wait(2.0, FORWARD, may_act=True)
    assert run.moves() == [LEFT]
    run.wait(1.0, may_act=True).wait(0.5, FORWARD, may_act=True)
    assert run.moves() == [LEFT, FORWARD]


def test_nodes_that_die_in_a_motion_are_stopped():
    run = gate_in_a_gesture()
    since_s = run.now_s
    run.wait(4.0, may_act=True)
    assert run.stands_after(since_s) <= GATE.SILENT_S


def test_after_a_hang_of_its_own_the_gate_is_closed():
    run = gate_in_a_gesture()
    run.now_s += 1.0
    run.watchdog.receive(FORWARD, run.now_s)
    assert run.moves() == [LEFT]
    assert run.sent[-1][1] == STAND
