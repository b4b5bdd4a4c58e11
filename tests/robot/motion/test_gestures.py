"""Gestures: the ones we bring along, and what is refused before a base ever moves."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.training.valences import VALENCES
from robot.motion.dry_run import dry_run
from robot.motion.gesture import VISIBLE_M, VISIBLE_RAD, Gesture, Waypoint
from robot.motion.gesture_errors import BadGesture
from robot.motion.gestures import GESTURES, known_names
from robot.motion.limits import REACH_M
from robot.motion.path import Drive, Turn, plan_path
from robot.motion.pose import HOME, Pose

pytestmark = pytest.mark.matrix

AWAY = Waypoint(0.1, 0.0, 0.0, within_s=4)
BACK = Waypoint(0.0, 0.0, 0.0, within_s=4)

poses = st.builds(Pose, st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-3, 3))


def test_every_cue_names_gestures_that_exist():
    cues = [valence.cue for valence in VALENCES.values()]
    named = {name for cue in cues for name in (cue.above, cue.below) if name is not None}
    assert named <= known_names()


@pytest.mark.parametrize("gesture", GESTURES.values(), ids=lambda one: one.name)
def test_each_is_short_near_and_never_goes_out_backwards(gesture):
    assert gesture.min_duration_s() <= 3.3  # its corners are cut: it takes up to 3 s
    assert max(waypoint.pose.distance_m(HOME) for waypoint in gesture.waypoints) <= REACH_M
    farthest_m, start = 0.0, HOME
    for waypoint in gesture.waypoints:
        for leg in plan_path(start, waypoint.pose):
            if isinstance(leg, Drive) and leg.by_m < 0:
                assert waypoint.pose.distance_m(HOME) < farthest_m  # the way it came
        farthest_m = max(farthest_m, waypoint.pose.distance_m(HOME))
        start = waypoint.pose


@pytest.mark.parametrize("gesture", GESTURES.values(), ids=lambda gesture: gesture.name)
@pytest.mark.parametrize("intensity", [0.1, 0.25, 0.5, 1])
@pytest.mark.parametrize("pace", [1, 0.5])
def test_what_is_done_was_seen(gesture, intensity, pace):
    """A nod at a tenth went 0 mm, and was done (issue 15)."""
    played = dry_run(gesture.scaled(intensity), pace=pace)
    assert played.outcome == "done"
    turned_rad = max(abs(pose.heading_rad) for pose in played.poses)
    if gesture.reach_m:
        assert played.farthest_m >= VISIBLE_M * 0.75  # it comes within 4 mm of each place
    else:
        assert turned_rad >= VISIBLE_RAD * 0.75


@pytest.mark.parametrize("intensity", [0, -1, 1.1, math.nan])
def test_no_gesture_grows(intensity):
    with pytest.raises(BadGesture, match="intensity"):
        GESTURES["celebrate"].scaled(intensity)


@given(poses, poses)
def test_legs_lead_from_a_pose_to_the_next(start, waypoint):
    x_m, y_m, heading_rad = start.x_m, start.y_m, start.heading_rad
    for leg in plan_path(start, waypoint):
        match leg:
            case Turn():
                heading_rad += leg.by_rad
                assert leg.heading_rad == pytest.approx(heading_rad)
            case Drive():
                assert leg.heading_rad == pytest.approx(heading_rad)
                x_m += leg.by_m * math.cos(heading_rad)
                y_m += leg.by_m * math.sin(heading_rad)
    end = Pose(x_m, y_m, heading_rad)
    assert end.distance_m(waypoint) < 1e-9
    assert heading_rad == pytest.approx(waypoint.heading_rad)


def test_a_place_behind_is_driven_to_backwards():
    assert plan_path(Pose(0.1), HOME) == (Turn(0, 0), Drive(0, 0, 0, -0.1), Turn(0, 0))


@pytest.mark.parametrize(
    ("waypoints", "cure"),
    [
        ((), "1 to 32 goals"),
        ((BACK,) * 33, "1 to 32 goals"),
        ((AWAY,), "last goal is home"),
        ((replace(BACK, heading_rad=0.5),), "last goal is home"),
        ((replace(AWAY, x_m=0.26), BACK), "further than 0.25 m"),
        ((replace(AWAY, y_m=math.nan), BACK), "not finite"),
        ((replace(AWAY, heading_rad=6.3), BACK), "more than once around"),
        ((replace(AWAY, pace=0.1), BACK), "pace"),
        ((replace(AWAY, pace=1.1), BACK), "pace"),
        ((replace(AWAY, within_s=1.0), BACK), "Goal 1 needs 1.6 s"),
        ((replace(AWAY, within_s=17), BACK), "up to 16 s"),
        ((replace(AWAY, hold_s=4.1), BACK), "hold included"),
        ((AWAY, BACK) * 7, "at most 16 s"),
    ],
)
def test_what_no_base_should_perform_is_refused_with_the_cure(waypoints, cure):
    with pytest.raises(BadGesture, match=cure):
        Gesture("bad", "Bad", waypoints)


def test_a_full_turn_comes_home():
    Gesture("spin", "Spin", (Waypoint(0.0, 0.0, math.tau, within_s=8),))
