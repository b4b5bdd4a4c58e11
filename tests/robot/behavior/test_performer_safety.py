"""What a base feels, who watches, how a gesture is announced: what stops a robot."""

from dataclasses import replace

import pytest

from robot.bases import Indication, SensorState
from robot.motion.gestures import GESTURES
from robot.motion.limits import TICK_S
from robot.motion.pose import HOME, Pose
from robot.motion.twist import STILL
from tests.support.extent import EVERYTHING
from tests.support.robot_stage import CUE, WELCOME, FeelingBase, Stage


def test_a_gesture_is_announced_half_a_second_before_it_moves(felt):
    felt.walk(*[1.0] * 5)
    felt.hear(type="step", time_s=5.0, performance=1.0)
    begun_s = felt.now_s
    felt.wait(TICK_S)
    assert felt.base.shown[-1] == (Indication.MOVING, False)
    assert len(felt.base.played) == len(felt.base.lit) == 1  # its score has begun
    assert felt.robot.body.player.is_busy
    while felt.base.read().twist.is_still:
        felt.wait(TICK_S)
    assert 0.5 <= felt.now_s - begun_s <= 0.5 + 3 * TICK_S
    felt.wait(5)
    assert felt.ended == ["done"]
    assert felt.base.shown[-1] == (Indication.READY, False)


@pytest.mark.parametrize("deed", [{"type": "stop"}, {"type": "state", "state": "paused"}])
def test_what_is_announced_can_still_be_called_off(felt, deed):
    felt.walk(*[1.0] * 5)
    felt.hear(type="step", time_s=5.0, performance=1.0)
    felt.wait(0.3)
    felt.hear(**deed)
    felt.wait(2)
    assert felt.base.read().pose == HOME
    assert len(felt.ended) == 1


def test_quiet_gestures_make_no_sound(felt):
    felt.hear(type="cue", cue=CUE | {"intensity": 0.5})
    felt.walk(*[1.0] * 6)
    felt.hear(type="stop")
    felt.wait(0.1)
    assert {indication for indication, _ in felt.base.shown} >= {
        Indication.MOVING,
        Indication.STOPPED,
    }
    assert not any(aloud for _, aloud in felt.base.shown)
    assert felt.base.lit
    assert not felt.base.played


@pytest.mark.parametrize("hazard", ["bump", "cliff", "wheel_drop", "over_current", "restarted"])
def test_what_it_feels_halts_it_at_the_next_tick_and_holds(felt, hazard):
    felt.walk(*[1.0] * 6)
    felt.wait(0.5)
    assert not felt.base.read().twist.is_still
    felt.base.sensors = SensorState(hazards=frozenset({hazard}))
    felt.wait(TICK_S)
    assert felt.base.read().twist == STILL
    assert felt.ended == [hazard]
    assert felt.of("stop") == [{"kind": "stop", "reason": hazard}]
    felt.wait(1)
    assert felt.state == ("stopped", hazard)
    assert felt.base.shown[-1] == (Indication.STOPPED, True)
    felt.base.sensors = SensorState()
    felt.walk(*[1.0] * 7)
    assert felt.of("decision")[-1]["reason"] == hazard
    felt.hear(type="stop")  # the server's echo of its report
    felt.wait(1)
    assert felt.state == ("stopped", hazard)
    felt.hear(type="arm")
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["gesture"] == "celebrate"


def test_it_cannot_be_armed_while_something_is_wrong(felt):
    felt.base.sensors = SensorState(hazards=frozenset({"cliff"}))
    felt.wait(2)
    felt.hear(type="arm")
    assert felt.of("stop") == [{"kind": "stop", "reason": "cliff"}] * 2
    felt.wait(1)
    assert felt.state == ("stopped", "cliff")
    assert felt.of("status")[-1]["counters"] == {"refused_arms": 1}


def test_its_button_stops_it_for_everyone(felt):
    felt.walk(*[1.0] * 6)
    felt.base.sensors = SensorState(stop_pressed=True)
    felt.wait(TICK_S)
    felt.base.sensors = SensorState()
    assert felt.of("stop") == [{"kind": "stop", "reason": "button"}]
    felt.wait(1)
    assert felt.state == ("stopped", "button")


def test_no_gesture_of_a_real_base_while_no_page_of_a_pt_is_open(felt):
    felt.hear(type="heartbeat", watched=False)
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["reason"] == "unwatched"
    assert felt.state == ("idle", "unwatched")
    felt.hear(type="heartbeat", watched=True)
    felt.walk(*[1.0] * 5)
    assert felt.of("decision")[-1]["gesture"] == "celebrate"
    felt.hear(type="heartbeat", watched=False)  # what runs comes home
    felt.wait(5)
    assert felt.ended == ["done"]


def test_a_server_that_says_nothing_of_pages_has_none(felt):
    felt.hear(**{name: value for name, value in WELCOME.items() if name != "watched"})
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["reason"] == "unwatched"


def test_nobody_need_look_at_a_simulation(stage):
    stage.hear(**WELCOME | {"watched": False})
    stage.walk(*[1.0] * 6)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_a_base_that_is_held_stops_for_good(felt):
    felt.base.is_held = True
    felt.walk(*[1.0] * 6)
    felt.wait(3)
    assert felt.of("stop") == [{"kind": "stop", "reason": "stalled"}]
    felt.wait(1)
    assert felt.state == ("stopped", "stalled")


def test_a_robot_that_hung_mid_gesture_does_not_go_on(felt):
    felt.walk(*[1.0] * 6)
    felt.wait(0.5)
    felt.now_s += 0.5
    felt.hear(type="heartbeat")
    felt.wait(TICK_S)
    assert felt.base.read().twist == STILL
    assert felt.ended == ["order_lapsed"]


@pytest.mark.parametrize(("hang_s", "first"), [(3, "messages"), (0.5, "a tick")])
def test_steps_that_waited_while_it_hung_begin_nothing_and_fresh_ones_do(felt, hang_s, first):
    felt.walk(*[1.0] * 5)
    felt.now_s += hang_s
    if first == "a tick":
        felt.robot.tick(felt.now_s)
    felt.hear(type="heartbeat")
    felt.hear(type="step", time_s=felt.source_s, performance=1.0)
    assert not felt.robot.may_act  # nor may another robot that acts on its decisions
    felt.wait(2 * TICK_S)
    assert felt.of("decision") == felt.of("gesture") == []
    assert felt.robot.may_act
    felt.walk(*[1.0] * 6)
    assert [decision["gesture"] for decision in felt.of("decision")] == ["celebrate"]


def test_a_stop_that_waited_while_it_hung_is_obeyed_and_an_arming_is_not(felt):
    felt.walk(*[1.0] * 6)
    assert felt.robot.body.player.is_busy
    felt.now_s += 3
    felt.hear(type="stop")
    assert felt.base.read().twist == STILL
    assert felt.ended == ["stopped"]
    felt.hear(type="arm")
    felt.wait(1)
    assert felt.state == ("stopped", "stopped")
    felt.hear(type="arm")
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["gesture"] == "celebrate"


def test_a_robot_without_a_session_waits_for_one():
    stage = Stage()
    stage.hear(type="welcome", session=None)
    stage.heartbeats = False
    stage.wait(5)
    assert stage.robot.is_linked
    assert stage.state == ("idle", "no_session")


@pytest.mark.parametrize(
    ("battery_v", "share", "low"),
    [(None, None, False), (16.5, 1, False), (14.0, 0.28, False), (13.9, 0.25, True)],
)
def test_the_battery_is_told_as_people_read_it(felt, battery_v, share, low):
    felt.base.sensors = SensorState(battery_v=battery_v)
    felt.wait(1.1)
    status = felt.of("status")[-1]
    assert status["battery_v"] == battery_v
    assert status["battery_share"] == (share if share is None else pytest.approx(share, abs=0.01))
    assert status["battery_low"] is low


class KeepingBase(FeelingBase):
    """A base that keeps a bump until it is read, and no longer."""

    def __init__(self, monotonic):
        super().__init__(monotonic)
        self.bumped = False

    def read(self):
        there, bumped = super().read(), getattr(self, "bumped", False)
        self.bumped = False
        hazards = frozenset({"bump"} if bumped else ())
        return replace(there, sensors=replace(there.sensors, hazards=hazards))


@pytest.mark.parametrize("reader", ["nobody", "a step", "an arming"])
def test_a_bump_of_50_ms_in_a_hang_of_0_2_s_is_never_lost(reader):
    """Also where another than the one who stops it has read it first, at any moment."""
    stage = Stage(KeepingBase)
    stage.hear(**WELCOME)
    for number in range(0, 100, 1 if EVERYTHING else 5):
        stage.wait(1.1)  # an arming sooner than that is refused
        stage.hear(type="arm")
        stage.robot.play_alone(GESTURES["sway"], stage.now_s)
        stage.wait(0.6 + number * 0.01)
        assert stage.robot.body.player.is_busy
        stage.base.bumped = True  # and over, before anyone looks
        stage.now_s += 0.2
        stage.hear(type="heartbeat")
        if reader == "a step":
            stage.robot.body.read()
        elif reader == "an arming":
            stage.hear(type="arm")
        stage.robot.tick(stage.now_s)
        assert stage.robot.body.safety.latch == "bump"
        assert not stage.robot.body.player.is_busy


@pytest.mark.parametrize("welcome", [{"session": 8}, {"state": "paused"}, {"session": None}])
def test_a_gesture_ends_with_the_session_that_ordered_it(stage, welcome):
    stage.perform()
    stage.hear(**WELCOME | welcome)
    stage.wait(1)
    assert stage.ended == ["replaced"]
    assert stage.base.read().twist.is_still


def test_the_same_sessions_welcome_lets_a_gesture_end(stage):
    stage.perform()
    stage.hear(**WELCOME)
    stage.wait(5)
    assert stage.ended == ["done"]


class WeakBase(FeelingBase):
    """A base that turns and drives a tenth as far as it is told, and says that it goes as told."""

    def read(self):
        there = super().read()
        pose = Pose(there.pose.x_m / 10, there.pose.y_m / 10, there.pose.heading_rad / 10)
        return replace(there, pose=pose)


def test_a_base_that_does_not_get_there_in_time_waits_for_a_person():
    stage = Stage(WeakBase)
    stage.hear(**WELCOME)
    stage.hear(type="arm")
    stage.walk(*[1.0] * 12)
    assert stage.ended == ["out_of_time"]
    assert stage.state == ("stopped", "stalled")
    stage.hear(type="arm")
    stage.wait(1)
    assert stage.state[0] != "stopped"
