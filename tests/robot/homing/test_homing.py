"""A robot that was moved drives home by its tag: only while held, never back, and says why not."""

import math
import random
from dataclasses import replace

import pytest

pytest.importorskip("cv2", reason="pip install garry[tag]")

from robot.bases import SensorState
from robot.behavior.manual_drive import HOLDS_S, SPEED_M_S, TURN_RAD_S
from robot.homing.home_view import Carried, Mount
from robot.motion.pose import HOME, Pose
from tests.support.tag_room import HomingStage, TagRoom, find_start, thing

WITHIN_M, WITHIN_DEG = 0.02, 2.0  # as near as a gesture has to end
BESIDE = Pose(-0.45, 0.25, -0.1)
# The second: a tag on its mast, at which a camera beside the treadmill looks.
ON_MAST = TagRoom(Carried.TAG, thing(1.0, 0.3, 0.4, -163.0, Carried.TAG), Mount(0.05, 0.0, -0.35))
ROOMS = {"camera_on_base": TagRoom(), "tag_on_mast": ON_MAST}


def assert_home(stage):
    stage.wait(1.0)
    assert stage.truth.distance_m(HOME) <= WITHIN_M
    assert math.degrees(stage.truth.turn_rad(HOME)) <= WITHIN_DEG


def assert_still(stage, moved):
    """Check that it has not been ordered to move, and has not moved."""
    assert all(twist.is_still for twist in stage.ordered)
    assert stage.truth == moved


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(n, marks=pytest.mark.long) for n in range(2, 20))]
)
def test_it_comes_home(room, seed):
    stage = HomingStage(find_start(ROOMS[room], random.Random(seed)), seed, ROOMS[room])
    assert stage.go_home() == "there"
    assert_home(stage)
    assert min(twist.v_m_s for twist in stage.ordered) >= 0
    assert max(twist.v_m_s for twist in stage.ordered) <= SPEED_M_S
    assert max(abs(twist.w_rad_s) for twist in stage.ordered) <= TURN_RAD_S


def test_at_home_a_person_has_to_arm_it_and_that_moves_nothing():
    stage = HomingStage(Pose(-0.3, 0.0, 0.05))
    assert stage.go_home() == "there"
    stage.wait(0.1)
    assert stage.state == ("disarmed", "disarmed")
    assert stage.of("status")[-1]["homing"] == "there"
    stage.hold(0.5)
    stage.hear(type="state", state="running")
    stage.hear(type="arm")
    stage.wait(1.0)
    assert stage.state == ("idle", "")
    assert_home(stage)
    stage.walk(1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    assert [report["phase"] for report in stage.of("gesture")] == ["started"]


@pytest.mark.parametrize("after_s", [1.5, 3.0, 6.0])
def test_it_stands_when_the_button_is_let_go_and_is_not_home(after_s):
    stage = HomingStage(BESIDE)
    stage.hold(after_s)
    before = stage.truth
    stage.wait(HOLDS_S + 0.5)
    assert stage.truth.distance_m(before) <= SPEED_M_S * (HOLDS_S + 0.4)
    stands = stage.truth
    stage.wait(5.0)
    assert stage.truth == stands
    assert stage.state == ("away", "away_from_home")
    stage.hear(type="state", state="running")
    stage.walk(*[1.0] * 12)
    assert stage.truth == stands  # no gesture begins there
    stage.hear(type="state", state="paused")
    assert stage.go_home() == "there"
    assert_home(stage)


def test_nothing_looks_before_somebody_holds_the_button():
    stage = HomingStage(BESIDE)
    stage.wait(5.0)
    assert stage.eye.watched == 0


@pytest.mark.parametrize(
    ("fault", "codes"),
    [
        ({"is_silent": True}, "camera_silent"),
        ({"problem": "no_camera"}, "no_camera"),
        ({"problem": "camera_dark"}, "camera_dark"),
        ({"every_s": 0.36}, "camera_slow"),
        ({"every_s": 0.8}, "camera_slow camera_silent"),
        ({"late_s": 1.0}, "camera_slow camera_silent"),  # frames that are older than they may be
    ],
)
def test_it_stands_where_its_camera_is_of_no_use_and_goes_on_when_it_is(fault, codes):
    stage = HomingStage(BESIDE)
    right = {name: getattr(stage.eye, name) for name in fault}
    for name, value in fault.items():
        setattr(stage.eye, name, value)
    stage.hold(6.0)
    assert stage.code in codes.split()
    assert_still(stage, BESIDE)
    for name, value in right.items():
        setattr(stage.eye, name, value)
    assert stage.go_home() == "there"


def test_a_camera_with_other_frames_than_home_was_learned_with_moves_nothing(monkeypatch):
    stage = HomingStage(BESIDE)
    take = stage.eye.take
    monkeypatch.setattr(
        stage.eye, "take", lambda: [replace(seen, size_px=(1280, 720)) for seen in take()]
    )
    stage.hold(4.0)
    assert stage.code == "camera_changed"
    assert_still(stage, BESIDE)


def test_without_its_tag_it_turns_twice_around_and_gives_up():
    stage = HomingStage(BESIDE)
    stage.eye.see = lambda pose: stage.eye.tags(pose, 12)  # another one
    assert stage.go_home() == "no_tag"
    assert all(twist.v_m_s == 0 for twist in stage.ordered)
    turned_rad = abs(stage.truth.heading_rad - BESIDE.heading_rad)
    assert math.tau * 1.85 < turned_rad < math.tau * 2
    stands = stage.truth
    stage.hold(5.0)
    assert stage.truth == stands


def test_two_tags_with_its_number_move_nothing():
    stage = HomingStage(BESIDE)
    stage.eye.see = lambda pose: stage.eye.tags(pose) * 2
    stage.hold(3.0)
    assert stage.code == "two_tags"
    assert_still(stage, BESIDE)


def test_beside_others_it_takes_its_own_tag():
    stage = HomingStage(BESIDE)
    stage.eye.see = lambda pose: [(12, ((9, 9), (99, 9), (99, 99), (9, 99))), *stage.eye.tags(pose)]
    assert stage.go_home() == "there"
    assert_home(stage)


def test_a_tag_that_moves_under_its_eyes_moves_nothing():
    stage, swings = HomingStage(BESIDE), random.Random(3)

    def see(pose):
        off_px = swings.uniform(-8, 8)
        return [
            (number, tuple((x + off_px, y) for x, y in corners))
            for number, corners in stage.eye.tags(pose)
        ]

    stage.eye.see = see
    stage.hold(3.0)
    assert stage.code == "tag_moves"
    assert_still(stage, BESIDE)


@pytest.mark.parametrize("by_m", [0.15, -0.15])
def test_a_tag_that_is_carried_elsewhere_meanwhile_ends_it(by_m):
    stage = HomingStage(Pose(-0.9, 0.1, 0.0), room=TagRoom())
    stage.hold(5.0)
    stage.room.fixed = stage.room.fixed.copy()
    stage.room.fixed[1, 3] += by_m
    assert stage.go_home() == "tag_contradicted"
    stands = stage.truth
    stage.hold(3.0)
    assert stage.truth.distance_m(stands) < 0.005


@pytest.mark.parametrize("size_m", [0.12, 0.2])
def test_a_tag_of_another_size_ends_it(size_m):
    """The sheet was replaced by one that a printer had scaled, since home was learned."""
    stage = HomingStage(Pose(-0.6, 0.1, 0.0), room=TagRoom())
    stage.room.size_m = size_m
    assert stage.go_home() == "tag_contradicted"


def test_a_tag_that_hangs_askew_moves_nothing():
    stage = HomingStage(BESIDE, room=TagRoom())
    tip_rad = math.radians(20)
    stage.room.fixed = stage.room.fixed.copy()
    turned = stage.room.fixed[:3, :3]
    across, down = turned[:, 0].copy(), turned[:, 1].copy()
    turned[:, 0] = math.cos(tip_rad) * across + math.sin(tip_rad) * down
    turned[:, 1] = math.cos(tip_rad) * down - math.sin(tip_rad) * across
    stage.hold(3.0)
    assert stage.code == "tag_not_level"
    assert_still(stage, BESIDE)


def test_too_far_away_it_is_to_be_carried():
    moved = Pose(-1.9, 0.0, 0.0)
    stage = HomingStage(moved)
    stage.hold(3.0)
    assert stage.code == "too_far"
    assert_still(stage, moved)


@pytest.mark.parametrize(
    "hazard",
    ["bump", "cliff", "wheel_drop", "button", "stop", "pause_ends", "silence", "unwatched"],
)
def test_what_stops_a_manual_drive_stops_it(hazard, monkeypatch):
    stage = HomingStage(BESIDE)
    stage.hold(4.0)
    assert not stage.ordered[-1].is_still
    read = stage.base.read
    if hazard == "stop":
        stage.hear(type="stop")
    elif hazard == "pause_ends":
        stage.hear(type="state", state="running")
    elif hazard == "unwatched":
        stage.hear(type="heartbeat", watched=False)
    elif hazard == "silence":
        stage.heartbeats = False
    else:
        felt = SensorState(stop_pressed=True)
        if hazard != "button":
            felt = SensorState(hazards=frozenset({hazard}))
        monkeypatch.setattr(stage.base, "read", lambda: replace(read(), sensors=felt))
    stage.wait(0.02 if hazard != "silence" else HOLDS_S + 0.04)
    assert stage.robot.body.ordered.is_still
    stage.wait(0.5)
    stands = stage.truth
    if hazard != "silence":
        stage.hold(3.0)  # holding on does not help
        assert stage.truth == stands


def test_what_holds_it_on_its_way_stops_it():
    stage = HomingStage(BESIDE)
    stage.hold(4.0)
    stage.base.held = 1.0
    stage.hold(2.0)
    assert stage.robot.body.safety.latch == "stalled"
    assert stage.robot.body.ordered.is_still
