"""A base that answers late: what is on its way to it is counted, and how late it is is measured."""

import math
from dataclasses import replace
from functools import partial

import pytest

from robot.bases.kinematic import Imperfections
from robot.motion.base_response import AT_ONCE, OrdersInFlight, Response
from robot.motion.delay_meter import DelayMeter
from robot.motion.gestures import GESTURES
from robot.motion.limits import TICK_S
from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import STILL, Twist
from tests.support.gesture_runs import play_in_a_row

pytestmark = pytest.mark.matrix

AHEAD = Twist(0.2, 0.0)


def test_orders_on_their_way_are_counted_and_answered_ones_are_not():
    flight = OrdersInFlight(0.2)
    for tick in range(50):  # a second ahead, then still
        flight.add(AHEAD if tick < 25 else STILL, tick * TICK_S)
        here = Pose(0.2 * max(0.0, min(tick * TICK_S - 0.2, 0.5)))  # a base that is 0.2 s late
        expected = 0.2 * min(tick * TICK_S, 0.5)
        assert flight.predict(here, tick * TICK_S).x_m == pytest.approx(expected)
        assert flight.answered(tick * TICK_S) == (AHEAD if 10 <= tick < 35 else STILL)


def test_without_a_delay_it_is_where_it_is():
    flight = OrdersInFlight(0.0)
    flight.add(AHEAD, 1.0)
    assert flight.predict(HOME, 1.5) == HOME
    assert flight.answered(1.5) == AHEAD


def test_a_clock_that_goes_back_forgets_what_lies_ahead():
    flight = OrdersInFlight(0.2)
    flight.add(AHEAD, 5.0)
    flight.add(STILL, 1.0)
    assert flight.predict(HOME, 1.1) == HOME


def ramps(tick):
    return Twist(0.15 * math.sin(tick / 15), 0.5 * math.sin(tick / 22))


@pytest.mark.parametrize("late", [0, 3, 10, 14.5])
def test_the_delay_is_measured_from_motion_alone(late):
    meter, pose = DelayMeter(), HOME
    assert meter.delay_s is None
    for tick in range(100):
        meter.add(ramps(tick - 1), pose, tick * TICK_S)
        for whole in (math.floor(late), math.ceil(late)):  # half a tick of each
            pose = advance(pose, ramps(tick - whole), TICK_S / 2)
    assert meter.delay_s == pytest.approx(late * TICK_S, abs=0.005)


@pytest.mark.parametrize("moves", [STILL, Twist(-0.1, 0.4)], ids=["held", "pushed"])
def test_of_a_base_that_does_not_follow_nothing_is_learnt(moves):
    meter, pose = DelayMeter(), HOME
    for tick in range(100):
        meter.add(ramps(tick), pose, tick * TICK_S)
        pose = advance(pose, moves, TICK_S)
    assert meter.delay_s is None


@pytest.mark.parametrize("bad", [{"lag_s": -1}, {"dead_time_s": 9}, {"wheel_scale": math.nan}])
def test_a_response_that_no_base_has_is_refused(bad):
    with pytest.raises(ValueError, match=r"s\.|numbers|between"):
        Response(**bad)


@pytest.mark.parametrize("gesture", GESTURES.values(), ids=lambda gesture: gesture.name)
@pytest.mark.parametrize("dead_time_s", [0.0, 0.1, 0.25])
@pytest.mark.parametrize("lag_s", [0.02, 0.06])
def test_a_late_base_ends_at_home_though_nobody_has_measured_it(gesture, dead_time_s, lag_s):
    """The full table is of `make bench`: tests/bench/test_late_gestures.py."""
    faults = Imperfections(dead_time_s, lag_s, left_scale=0.98, drift_deg_min=3.0)
    for played in play_in_a_row(gesture, faults, times=2):
        assert played.outcome == "done"
        assert played.away_m < 0.02
        assert played.turned_deg < 2
        assert played.took_s <= 4.5


def test_one_that_plans_from_where_it_is_would_fail(monkeypatch):
    """The fault that the prediction mends (issue 15): a plan from the pose as it is."""
    monkeypatch.setattr("robot.motion.player.DelayMeter.delay_s", None)
    played = play_in_a_row(GESTURES["sway"], Imperfections(0.16), times=2, response=AT_ONCE)
    assert played[-1].outcome != "done"


@pytest.mark.parametrize(
    ("field", "least", "most"),
    [("lag_s", 0.0, 0.6), ("wheel_scale", 0.8, 1.2), ("stiction_m_s", 0.0, 0.08)],
)
def test_a_response_is_accepted_within_its_bounds_alone(field, least, most):
    of_base = partial(replace, Response(dead_time_s=0.0))
    assert [getattr(of_base(**{field: at}), field) for at in (least, most)] == [least, most]
    for beyond in (math.nextafter(least, -1), math.nextafter(most, 9), math.nan):
        with pytest.raises(ValueError, match=r"0 or more|lies|finite"):
            of_base(**{field: beyond})


def test_one_that_answers_at_once_is_believed():
    """A measured delay of 0 was taken for none: it stopped short, 5 mm from home (issue 36)."""
    played = play_in_a_row(GESTURES["nod"], Imperfections(0.0, 0.02), times=4)
    assert max(one.away_m for one in played) < 0.0025
