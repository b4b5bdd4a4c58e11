"""What every base promises; and the simulated one against arithmetic."""

import math

import pytest

from robot.bases import BASES, BaseState
from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, ORDER_HOLDS_S
from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import STILL, Twist
from robot.simulation import SIMULATED_BASES

SIMULATED = ["null", "kinematic"]


class Clock:
    """A clock that is told the time."""

    def __init__(self):
        self.now_s = 50.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture(params=SIMULATED)
def base(request, clock):
    with BASES[request.param](clock) as base:
        yield base


def test_each_simulated_base_is_tried_here():
    assert SIMULATED_BASES == SIMULATED  # the twin: test_twinned


def test_a_base_knows_its_name(base):
    assert BASES[base.name] is type(base)


def test_it_begins_at_home_and_still(base):
    assert base.read() == BaseState(HOME, STILL)


def test_it_says_what_was_really_ordered(base, clock):
    sent = base.drive(Twist(9, -9))
    assert abs(sent.v_m_s) <= CEILING_M_S
    assert abs(sent.w_rad_s) <= CEILING_RAD_S
    assert base.read().twist == sent
    assert base.abilities.moves == (not sent.is_still)


@pytest.mark.parametrize("bad", [Twist(math.nan, 0), Twist(0.1, math.inf)])
def test_an_order_that_is_not_finite_stops_it(base, bad):
    base.drive(Twist(0.1, 0))
    assert base.drive(bad) == STILL
    assert base.read().twist == STILL


def test_an_order_grows_old(base, clock):
    base.drive(Twist(0.1, 0.2))
    clock.now_s += 10
    there = base.read()
    assert there.twist == STILL
    clock.now_s += 10
    assert base.read() == there
    most = advance(HOME, Twist(0.1, 0.2), ORDER_HOLDS_S)
    assert there.pose.distance_m(HOME) <= most.distance_m(HOME) + 1e-9


def test_stopping_stops_where_it_is(base, clock):
    base.drive(Twist(0.1, 0))
    clock.now_s += 0.1
    base.stop()
    there = base.read().pose
    clock.now_s += 0.1
    assert base.read() == BaseState(there, STILL)


def test_home_is_where_it_is_put(base, clock):
    base.drive(Twist(0.1, 0.5))
    clock.now_s += 0.2
    base.set_home()
    assert base.read() == BaseState(HOME, STILL)


def test_leaving_it_stops_it(clock):
    with BASES["kinematic"](clock) as base:
        base.drive(Twist(0.1, 0))
    clock.now_s += 1
    assert base.read() == BaseState(HOME, STILL)


def test_a_clock_that_goes_back_moves_nothing(clock):
    base = BASES["kinematic"](clock)
    base.drive(Twist(0.1, 0))
    clock.now_s -= 10
    assert base.read().pose == HOME


def test_the_kinematic_base_does_what_it_is_told(clock):
    base, expected = BASES["kinematic"](clock), HOME
    for number in range(50):
        twist = Twist(0.1 + number / 1000, 0.5 - number / 50)
        base.drive(twist)
        clock.now_s += 0.02
        expected = advance(expected, twist, 0.02)
    there = base.read().pose
    assert there.distance_m(expected) < 1e-9
    assert there.heading_rad == pytest.approx(expected.heading_rad)
    assert isinstance(there, Pose)
