"""What a robot does with what it hears: it answers windows, and moves only while all allows it."""

import pytest

from robot.behavior.safety import SERVER_SILENT_S
from robot.motion.gestures import ORIGINALS
from robot.motion.limits import TICK_S
from robot.motion.pose import HOME
from robot.motion.twist import STILL, Twist
from tests.support.robot_stage import CUE, WELCOME, RealBase, Stage


def test_a_strong_window_is_celebrated_and_told(stage):
    stage.perform().wait(4)
    (decision,) = stage.of("decision")
    assert decision == {
        "kind": "decision",
        "from_s": 0.0,
        "until_s": 5.0,
        "steps": 5,
        "mean": 1.0,
        "threshold": 0.9,
        "above": True,
        "gesture": "celebrate",
        "intensity": 0.75,
        "reason": "",
        "activated_share": 1.0,
    }
    assert stage.of("gesture") == [
        {"kind": "gesture", "name": "celebrate", "phase": "started", "outcome": ""},
        {"kind": "gesture", "name": "celebrate", "phase": "ended", "outcome": "done"},
    ]
    assert stage.state == ("idle", "")
    pose = stage.base.read().pose
    assert pose.distance_m(HOME) < 0.01


def test_a_weak_window_droops(stage):
    stage.walk(*[0.1] * 6)
    (decision,) = stage.of("decision")
    assert (decision["gesture"], decision["above"]) == ("droop", False)
    assert decision["intensity"] == 1  # it never grows with the weakness
    first, second, *later = (one["look"][1] for one in stage.of("status") if one["gesture"])
    assert first == second > later[0] == later[1]  # the eyes begin open and fall


def test_status_comes_every_second_and_four_times_while_it_moves(stage):
    stage.wait(10)
    assert 10 <= len(stage.of("status")) <= 12
    idle = len(stage.reports)
    stage.perform()
    stage.wait(2.5)
    moving = [r for t, r in stage.reports[idle:] if r.get("state") == "performing"]
    assert 10 <= len(moving) <= 13
    assert len({report["pose"]["x_m"] for report in moving}) > 5
    assert {report["gesture"] for report in moving} == {"celebrate"}


@pytest.mark.parametrize("state", ["paused", "finished", "aborted"])
def test_a_session_that_does_not_run_eases_the_robot_to_a_stop(stage, state):
    stage.perform()
    stage.hear(type="state", state=state)
    assert stage.robot.body.player.is_busy  # it slows down, it does not jerk
    stage.wait(0.5)
    assert stage.base.read().twist == STILL
    assert stage.ended == [state]
    stage.walk(*[1.0] * 12)
    assert len(stage.of("decision")) == 1
    assert stage.state == ("idle", "not_running")


def test_steps_before_a_pause_are_not_made_up_for(stage):
    stage.walk(1.0, 1.0, 1.0, 1.0)
    stage.hear(type="state", state="paused")
    stage.wait(3)
    stage.hear(type="state", state="running")
    stage.source_s = 60.0
    stage.walk(0.5, 0.5)
    assert not stage.of("decision")


def test_silence_halts_it_within_three_quarters_of_a_second(stage):
    stage.perform()
    stage.heartbeats = False
    silent_s = stage.now_s
    while stage.robot.body.player.is_busy:
        stage.wait(TICK_S)
    assert stage.now_s - silent_s <= SERVER_SILENT_S + 2 * TICK_S <= 0.75
    assert stage.base.read().twist == STILL
    assert stage.ended == ["no_link"]
    stage.heartbeats = True
    stage.walk(*[1.0] * 12)  # of the old connection: it counts no more
    assert len(stage.of("decision")) == 1
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 12)
    assert len(stage.of("decision")) == 3


def test_a_lost_link_halts_it_at_once(stage):
    stage.perform()
    stage.robot.disconnect("no_link")
    assert stage.base.read().twist == STILL
    before = len(stage.of("status"))
    stage.wait(3)
    assert stage.ended == ["no_link"]
    assert len(stage.of("status")) == before  # there is nobody to tell


def test_a_stop_is_immediate_and_holds_until_someone_arms_it(stage):
    stage.perform()
    stage.hear(type="stop")
    assert stage.base.read().twist == STILL
    assert stage.ended == ["stopped"]
    stage.hear(type="stop")
    stage.walk(*[1.0] * 12)
    assert stage.state == ("stopped", "stopped")
    stage.robot.disconnect("no_link")
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 12)
    assert {decision["reason"] for decision in stage.of("decision")[1:]} == {"stopped"}
    stage.hear(type="arm")
    stage.walk(*[1.0] * 7)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_a_stop_counts_before_any_welcome():
    stage = Stage()
    stage.hear(type="stop")
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 6)
    assert stage.of("decision")[0]["reason"] == "stopped"


def test_a_stop_that_was_missed_is_in_the_welcome(stage):
    stage.perform()
    stage.hear(**WELCOME | {"stopped": True})
    assert stage.base.read().twist == STILL
    stage.wait(1)
    assert stage.state == ("stopped", "stopped")


def test_only_a_person_arms_a_real_base():
    stage = Stage(RealBase)
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 7)
    assert stage.state == ("disarmed", "disarmed")
    assert stage.of("decision")[0]["reason"] == "disarmed"
    stage.hear(type="arm")
    stage.walk(*[1.0] * 5)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"
    stage.robot.disconnect("no_link")
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 7)
    assert stage.of("decision")[-1]["reason"] == "disarmed"


def test_a_real_base_away_from_home_waits_for_a_person_to_put_it_back():
    stage = Stage(RealBase)
    stage.hear(**WELCOME)
    stage.hear(type="arm")
    stage.perform()
    stage.hear(type="state", state="paused")
    stage.wait(1)
    for _ in range(50):  # pushed
        stage.base.drive(Twist(0.1, 0))
        stage.now_s += TICK_S
    stage.hear(type="state", state="running")
    stage.walk(*[1.0] * 8)
    assert stage.of("decision")[-1]["reason"] == "away_from_home"
    assert stage.state == ("away", "away_from_home")
    stage.hear(type="arm")
    stage.wait(1)
    assert stage.state == ("idle", "")
    stage.walk(*[1.0] * 5)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_a_simulated_base_is_carried_home(stage):
    stage.perform()
    stage.wait(1)
    stage.hear(type="state", state="paused")
    stage.wait(1)
    for _ in range(50):  # pushed
        stage.base.drive(Twist(0.1, 0))
        stage.now_s += TICK_S
    assert stage.base.read().pose.distance_m(HOME) > 0.05
    stage.hear(type="state", state="running")
    stage.walk(*[1.0] * 6, every_s=1.2)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_another_session_begins_with_a_share_of_its_own(stage):
    stage.walk(*[0.5] * 11)
    assert stage.of("decision")[-1]["activated_share"] == 0
    stage.hear(**WELCOME | {"session": 8})
    stage.walk(*[1.0] * 11)
    assert stage.of("decision")[-1]["activated_share"] == 1


def test_no_session_no_gesture(stage):
    stage.perform()
    stage.hear(type="welcome", session=None)
    stage.wait(1)
    assert stage.ended == ["replaced"]
    assert stage.state == ("idle", "no_session")


def farthest_m(stage):
    return max(report["pose"]["x_m"] for report in stage.of("status"))


@pytest.mark.parametrize(
    ("intensity", "performance", "share", "away_m"),
    [
        (1, 1.2, 1, 0.05),
        (1, 1.0, 0.75, 0.0375),
        (1, 0.9, 0.5, 0.025),
        (0.5, 1.2, 0.5, 0.025),
        (0.5, 0.9, 0.25, 0.02),  # as small as can be seen
    ],
)
def test_a_celebration_is_as_large_as_order_and_walk_ask_for(
    stage, intensity, performance, share, away_m
):
    stage.hear(type="cue", cue=CUE | {"intensity": intensity})
    stage.walk(*[performance] * 6)
    stage.wait(5)
    assert stage.of("decision")[0]["intensity"] == pytest.approx(share, abs=1e-3)
    assert farthest_m(stage) == pytest.approx(away_m, abs=0.006)
    assert stage.ended == ["done"]


@pytest.mark.parametrize("name", ORIGINALS)
@pytest.mark.parametrize("intensity", [1, 0.5])
def test_the_paper_s_gestures_are_the_same_every_time(stage, name, intensity):
    stage.hear(type="cue", cue=CUE | {"above": name, "intensity": intensity})
    stage.walk(*[0.9] * 6)
    assert stage.of("decision")[0]["intensity"] == intensity
    stage.wait(40)
    assert stage.ended == ["done"]
    assert stage.base.read().pose.distance_m(HOME) < 0.01


def test_a_quiet_robot_goes_half_as_far_at_half_the_speed_in_the_same_time():
    def look(intensity):
        stage = Stage()
        stage.hear(**WELCOME | {"cue": CUE | {"intensity": intensity}})
        stage.walk(*[1.2] * 5)
        stage.hear(type="step", time_s=stage.source_s, performance=1.2)
        speeds = []
        while stage.robot.body.player.is_busy:
            stage.wait(TICK_S)
            speeds.append(abs(stage.base.read().twist.v_m_s))
        return max(speeds), len(speeds) * TICK_S

    (loud_m_s, loud_s), (quiet_m_s, quiet_s) = look(1), look(0.5)
    assert quiet_m_s == pytest.approx(loud_m_s / 2, rel=0.15)
    assert quiet_s == pytest.approx(loud_s, rel=0.15)


def test_a_robot_that_is_off_decides_and_stands_still(stage):
    stage.perform()
    stage.hear(type="cue", cue=CUE | {"intensity": 0})
    assert stage.robot.body.player.is_busy  # what has begun comes home
    stage.walk(*[1.0] * 12)
    assert stage.ended == ["done"]
    last = stage.of("decision")[-1]
    assert (last["gesture"], last["intensity"], last["reason"]) == (None, None, "off")
    assert last["activated_share"] == 1


@pytest.mark.parametrize("first_s", [0.0, 1.8e9, -1e10, 1e10 - 100])  # of a device, Unix, any
def test_steps_of_any_clock_are_answered(first_s):
    stage = Stage()
    stage.source_s = first_s
    stage.hear(**WELCOME)
    stage.walk(*[1.2] * 7)
    assert stage.robot.bad_messages == 0
    assert [one["gesture"] for one in stage.of("decision")] == ["celebrate"]
