"""Odometry: where a base is by its wheels and its gyro, whose drift it learns at rest."""

import math

import pytest

from robot.bases.kinematic import Imperfections
from robot.bases.odometry import Odometry
from robot.motion.gestures import GESTURES
from robot.motion.twist import WHEELBASE_M
from tests.support.gesture_runs import play_in_a_row

FRAME_S = 0.02


class Walk:
    """An odometry that is fed frames of a base with a gyro that drifts."""

    def __init__(self, drift_deg_s, **more):
        self.odometry = Odometry(**more)
        self.drift_rad_s = math.radians(drift_deg_s)
        self.now_s = self.left_m = self.right_m = self.gyro_rad = 0.0
        self.odometry.add(0.0, 0.0, 0.0, 0.0, 0.0)

    def go(self, for_s, v_m_s=0.0, w_rad_s=0.0):
        for _ in range(round(for_s / FRAME_S)):
            self.now_s += FRAME_S
            self.left_m += (v_m_s - w_rad_s * WHEELBASE_M / 2) * FRAME_S
            self.right_m += (v_m_s + w_rad_s * WHEELBASE_M / 2) * FRAME_S
            self.gyro_rad += (w_rad_s + self.drift_rad_s) * FRAME_S
            self.odometry.add(
                self.left_m, self.right_m, self.gyro_rad, w_rad_s + self.drift_rad_s, self.now_s
            )
        return self.odometry


@pytest.mark.parametrize("drift_deg_s", [0.05, -0.5])
def test_drift_is_learnt_at_rest_and_taken_off_in_motion(drift_deg_s):
    walk = Walk(drift_deg_s)
    walk.go(2.0)
    walk.go(10.0, w_rad_s=0.4)
    assert walk.odometry.pose.heading_rad == pytest.approx(4.0, abs=0.001)
    assert walk.odometry.slip_rad == pytest.approx(0.0, abs=0.001)


def test_without_a_rest_the_drift_is_in_the_slip():
    walk = Walk(0.5)
    walk.go(0.1)
    walk.go(10.0, w_rad_s=0.4)
    assert walk.odometry.pose.heading_rad == pytest.approx(4.0 + math.radians(5), abs=0.002)
    assert walk.odometry.slip_rad == pytest.approx(-math.radians(5), abs=0.002)


def test_a_calibrated_drift_counts_before_any_rest():
    walk = Walk(0.5, drift_rad_s=math.radians(0.5))
    walk.go(10.0, w_rad_s=0.4)
    assert walk.odometry.pose.heading_rad == pytest.approx(4.0, abs=0.002)


def test_what_was_learnt_makes_room_for_what_is():
    walk = Walk(0.2)
    walk.go(10)
    walk.drift_rad_s = math.radians(-0.1)
    walk.go(240)
    assert math.degrees(walk.odometry.drift_rad_s) == pytest.approx(-0.1, abs=0.01)


def test_a_turn_by_hand_is_no_drift():
    walk = Walk(0.0)
    walk.go(2)
    walk.drift_rad_s = math.radians(20)  # lifted and turned: the wheels stand
    walk.go(1)
    walk.drift_rad_s = 0.0
    walk.go(2)
    assert math.degrees(walk.odometry.pose.heading_rad) == pytest.approx(20, abs=0.5)
    assert walk.odometry.drift_rad_s == pytest.approx(0, abs=1e-6)


def test_a_pause_between_frames_teaches_nothing():
    walk = Walk(0.0)
    walk.go(1)
    walk.now_s += 10
    walk.gyro_rad += 1.0  # it was off
    walk.go(1)
    assert walk.odometry.drift_rad_s == pytest.approx(0, abs=1e-6)


def test_wheels_that_roll_too_far_are_taken_back():
    walk = Walk(0.0, wheel_scale=1.02)
    walk.go(5.0, v_m_s=0.102)
    assert walk.odometry.pose.x_m == pytest.approx(0.5)


@pytest.mark.wide
@pytest.mark.parametrize("drift_deg_min", [3.0, 30.0, -30.0])
def test_twenty_celebrations_keep_their_heading(drift_deg_min):
    played = play_in_a_row(
        GESTURES["celebrate"], Imperfections(drift_deg_min=drift_deg_min), times=20
    )
    assert [one.outcome for one in played] == ["done"] * 20
    assert max(one.turned_deg for one in played) < 2


@pytest.mark.parametrize("drift_deg_min", [30.0, -60.0])
def test_a_heading_that_wanders_unseen_is_refused_as_away_from_home(monkeypatch, drift_deg_min):
    """A drift that no rest has taught, as of a sensor that warms up while it moves."""
    monkeypatch.setattr(Odometry, "_learn_drift", lambda *_: None)
    played = play_in_a_row(
        GESTURES["celebrate"], Imperfections(drift_deg_min=drift_deg_min), times=20
    )
    assert played[-1].outcome == "away_from_home"
    assert max(one.turned_deg for one in played[:-1]) < 2 + abs(drift_deg_min) / 60 * 4.5


def test_wheels_of_unequal_size_are_no_doubt_and_a_slip_is():
    walk = Walk(0.0)
    walk.go(1)
    for _ in range(20):  # a left wheel 2 % too small, kept straight by the gyro
        walk.go(1.5, v_m_s=0.2)
        walk.left_m += 0.02 * 0.3
    walk.go(0.1, v_m_s=0.01)
    assert walk.odometry.slip_rad == pytest.approx(-20 * 0.02 * 0.3 / WHEELBASE_M, abs=0.001)
    assert walk.odometry.doubt_rad == 0
    walk.odometry.set_home()
    walk.left_m += 0.01
    walk.go(0.1, v_m_s=0.01)
    assert walk.odometry.doubt_rad == pytest.approx(0.01 / WHEELBASE_M, abs=0.001)
