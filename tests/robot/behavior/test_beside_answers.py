"""What a robot does beside answers: greeting, rest, farewell, idle life; and where it is still."""

import itertools
import math

import pytest

from robot.bases.kinematic import KinematicBase
from robot.behavior.beside_answers import MOMENTS
from robot.behavior.idle import IdleLife
from robot.behavior.safety import ANNOUNCE_S
from robot.motion.face_and_arms import ACT_OF
from robot.motion.gesture_variants import IDLE
from robot.wire.cue_limits import VARIED
from tests.support.robot_stage import CUE, WELCOME, RealBase, Stage

FREE_CUE = CUE | {"above": VARIED, "below": None, "idles": True}
READY = WELCOME | {"cue": FREE_CUE, "state": "ready"}
MEANT = {"greeting": "running", "rest": "paused", "farewell": "finished"}


def began(stage):
    return [one["name"] for one in stage.of("gesture") if one["phase"] == "started"]


def idles(stage):
    return [name for name in began(stage) if name.startswith("idle")]


def order(stage, moment):
    """Have a moment ordered as a session does it: with a change of its state."""
    if moment == "greeting":
        stage.hear(**READY)
        stage.wait(0.1)
    else:
        stage.hear(**WELCOME | {"cue": FREE_CUE})
        stage.wait(0.1)
    stage.hear(type="state", state=MEANT[moment], gesture=moment)


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_moment_is_performed_once_logged_with_its_seed_and_ends_at_home(moment):
    stage = Stage(KinematicBase)
    order(stage, moment)
    stage.wait(5)
    (start,) = [one for one in stage.of("gesture") if one["phase"] == "started"][:1]
    assert (start["pool"], start["seed"]) == (moment, 7)
    assert start["name"].startswith(moment)
    assert stage.ended[0] == "done"
    pose = stage.base.ground_truth().pose
    assert math.hypot(pose.x_m, pose.y_m) < 0.02
    assert abs(pose.heading_rad) < math.radians(2)
    stage.wait(30)
    assert sum(name.startswith(moment) for name in began(stage)) == 1
    assert (stage.state == ("idle", "not_running")) is (moment != "greeting")


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize(
    "against",
    [
        {"type": "stop"},
        {"type": "cue", "cue": FREE_CUE | {"intensity": 0}},
        {"type": "cue", "cue": FREE_CUE | {"only_informs": True}},
        {"type": "heartbeat", "watched": False},
    ],
)
def test_no_moment_comes_where_the_robot_may_not_act(moment, against):
    stage = Stage(RealBase)
    stage.hear(**READY if moment == "greeting" else WELCOME | {"cue": FREE_CUE})
    stage.hear(type="arm")
    stage.heartbeats = False
    stage.hear(**against)
    stage.hear(type="state", state=MEANT[moment], gesture=moment)
    for _ in range(60):
        stage.hear(type="heartbeat")
        stage.wait(0.1)
    assert began(stage) == []


@pytest.mark.parametrize("state", ["ready", "paused", "finished"])
def test_what_did_not_run_takes_no_leave(state):
    stage = Stage()
    stage.hear(**READY | {"state": state})
    stage.hear(type="state", state="finished", gesture="farewell")
    stage.wait(5)
    assert began(stage) == []


def test_an_answer_that_is_played_is_ended_and_no_farewell_follows_it():
    stage = Stage()
    stage.hear(**WELCOME | {"cue": FREE_CUE | {"idles": False}})
    stage.walk(*[1.0] * 6)
    stage.hear(type="state", state="finished", gesture="farewell")
    stage.wait(5)
    assert len(began(stage)) == 1
    assert stage.ended == ["finished"]


@pytest.mark.parametrize("end", ["stop", "silence", "state"])
def test_what_ends_any_motion_ends_a_farewell(end):
    stage = Stage()
    order(stage, "farewell")
    stage.wait(1.2)
    if end == "silence":
        stage.heartbeats = False
    elif end == "stop":
        stage.hear(type="stop")
    else:
        stage.hear(type="state", state="aborted")
    stage.wait(1.0)
    assert len(stage.ended) == 1
    assert stage.ended[0] in ("stopped", "no_link", "aborted")
    at = stage.base.read().pose
    stage.wait(3)
    assert stage.base.read().pose == at
    assert len(began(stage)) == 1


def test_a_moment_of_another_kind_is_counted_and_the_state_obeyed():
    stage = Stage()
    stage.hear(**WELCOME | {"cue": FREE_CUE})
    for gesture in ("joy", "dance", ["rest"], 7):
        stage.hear(type="state", state="paused", gesture=gesture)
    stage.wait(3)
    assert stage.robot.bad_messages == 4
    assert began(stage) == []
    assert stage.state == ("idle", "not_running")


def test_a_moment_that_waited_while_the_robot_hung_is_left_out():
    stage = Stage()
    stage.hear(**READY)
    stage.wait(0.1)
    stage.now_s += 0.4
    stage.hear(type="state", state="running", gesture="greeting")
    stage.wait(3)
    assert began(stage) == []


@pytest.mark.parametrize("intensity", [1, 0.5])
def test_idle_life_costs_no_answer_and_ends_at_home(intensity):
    cue = FREE_CUE | {"intensity": intensity}
    walked = [1.0, 1.1, 0.5, 0.6, 0.5] * 6 + [0.4] * 60

    def answers(**more):
        stage = Stage(KinematicBase)
        stage.hear(**WELCOME | {"cue": cue | more})
        stage.walk(*walked)
        return stage

    living, still = answers(), answers(idles=False)
    assert living.of("decision") == still.of("decision")
    assert len(idles(living)) >= 2
    assert len(set(idles(living))) >= 2
    assert idles(still) == []
    assert set(living.ended) == {"done"}
    pose = living.base.ground_truth().pose
    assert math.hypot(pose.x_m, pose.y_m) < 0.02
    assert abs(pose.heading_rad) < math.radians(2)
    assert {one["pool"] for one in living.of("gesture") if one.get("pool")} == {"idle"}


@pytest.mark.parametrize(
    "still",
    [
        {"idles": False},  # baseline, catch, washout; a fixed gesture
        {"intensity": 0},
        {"only_informs": True},
        {"rule": "steps", "count": 3},  # an answer may be due at any moment
    ],
)
def test_it_stands_still_where_it_could_distract(still):
    stage = Stage()
    stage.hear(**WELCOME | {"cue": FREE_CUE | {"above": None} | still})
    stage.walk(*[0.5, 1.0] * 40)
    assert began(stage) == []
    assert stage.base.read().pose.x_m == 0


def test_it_idles_while_somebody_rests_and_not_after_a_stop_or_a_pause():
    stage = Stage()
    stage.hear(**WELCOME | {"cue": FREE_CUE})
    stage.walk(0.5, 0.5)
    stage.wait(60)
    seen = idles(stage)
    assert len(seen) >= 4
    assert all(one != after for one, after in itertools.pairwise(seen))
    stage.hear(type="state", state="paused")
    stage.wait(5)
    seen = idles(stage)
    stage.wait(40)
    stage.hear(type="state", state="running")
    stage.hear(type="stop")
    stage.wait(40)
    assert idles(stage) == seen


@pytest.mark.parametrize("released_s", [0.0, 0.4])
def test_nobody_is_greeted_while_a_person_drives_it_to_its_mark(released_s):
    stage = Stage(RealBase)
    stage.hear(**READY)
    stage.hear(type="arm")
    stage.hear(type="drive", ahead=1, left=0)
    stage.wait(0.1)
    assert not stage.robot.body.ordered.is_still
    stage.wait(released_s)
    stage.hear(type="state", state="running", gesture="greeting")
    stage.wait(2)
    assert len(began(stage)) == (released_s > 0)


@pytest.mark.parametrize("when_s", [3, 6, 9, 12])
def test_an_arming_is_followed_by_no_idle_motion_that_was_due(when_s):
    stage = Stage(RealBase)
    stage.hear(**WELCOME | {"cue": FREE_CUE})
    stage.hear(type="arm")
    stage.wait(when_s)
    stage.hear(type="stop")
    stage.wait(30)
    seen = began(stage)
    stage.hear(type="arm")
    stage.wait(4.9)
    assert began(stage) == seen
    stage.wait(30)
    assert len(began(stage)) > len(seen)


def test_all_idle_motions_come_and_none_twice_in_a_row():
    life = IdleLife(7)
    motions = [one for s in range(600) if (one := life.next(float(s), math.inf, 1.0))]
    assert set(motions) == set(IDLE)
    assert all(a is not b for a, b in itertools.pairwise(motions))


def test_idle_motions_are_small_and_slow_and_make_no_sound():
    for gesture in IDLE:
        assert gesture.reach_m <= 0.03
        assert gesture.turn_rad <= math.radians(10) + 1e-9
        assert max(one.pace for one in gesture.waypoints) <= 0.5
        assert not gesture.score.notes
        assert gesture.min_duration_s() + ANNOUNCE_S < 3.2
    assert ACT_OF["idle"] == "idling"
