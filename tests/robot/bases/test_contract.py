"""What every base promises: a new one is added to ``STAGES``, and passes."""

import math
import time
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

from robot.bases import BASES, Answer, Indication
from robot.bases.kinematic import KinematicBase
from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, ORDER_HOLDS_S
from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import STILL, Twist
from robot.simulation import SIMULATED_BASES
from tests.support.fake_kobuki import FakeKobuki
from tests.support.robot_stage import IdealBase
from tests.support.rosbridge_stage import Stage as RosStage

TICK_S = 0.02
SIMULATED = ["null", "kinematic"]
TAKES_S = 0.8  # an order to the wheels of a late base and back, on a busy machine


class Clock:
    """A clock that is told the time."""

    def __init__(self):
        self.now_s = 50.0

    def __call__(self):
        return self.now_s

    def wait(self, span_s):
        self.now_s += span_s


class RealClock:
    """The computer's."""

    def __call__(self):
        return time.monotonic()

    def wait(self, span_s):
        time.sleep(span_s)


class Stage:
    """A base, open or not, with its clock."""

    def __init__(self, base, clock):
        self.base, self.clock = base, clock

    def drive(self, twist, for_s):
        """Order a twist 50 times a second, and return what was really ordered last."""
        for _ in range(round(for_s / TICK_S)):
            ordered = self.base.drive(twist)
            self.clock.wait(TICK_S)
        return ordered

    def ready(self):
        """Order it to stand until it may be ordered to move."""
        if not isinstance(self.clock, Clock):
            self.drive(STILL, 0.2)
        return self


@contextmanager
def simulated(name):
    clock = Clock()
    base: Any = IdealBase(clock) if name == "kinematic" else BASES[name](clock)
    if name == "avatar":
        base.face.port = 0
    yield Stage(base, clock)


@contextmanager
def twin():
    clock = RealClock()
    yield Stage(BASES["twin"](clock), clock)


@contextmanager
def kobuki():
    clock = RealClock()
    with FakeKobuki() as fake:
        base = BASES["kobuki"](clock)
        base.port = fake.url
        yield Stage(base, clock)


class RosClock:
    """The clock of a bridge and its base, over no socket (tests/robot/ros has those)."""

    def __init__(self, ros):
        self.ros = ros

    def __call__(self):
        return self.ros.now_s

    def wait(self, span_s):
        for _ in range(round(span_s / TICK_S)):
            self.ros.now_s += TICK_S
            self.ros.pass_on()


@contextmanager
def rosbridge():
    ros = RosStage()
    ros.lose()
    base: Any = ros.base
    base.open, base.close = ros.open, lambda: None
    yield Stage(base, RosClock(ros))


def is_still(there):
    """Whether a base stands, as far as its sensors tell."""
    return abs(there.twist.v_m_s) < 0.003 and abs(there.twist.w_rad_s) < 0.02


STAGES: dict[str, Any] = {
    **{name: lambda name=name: simulated(name) for name in (*SIMULATED, "avatar")},
    "twin": twin,
    "kobuki": kobuki,
    "rosbridge": rosbridge,
}
REAL_TIME = ("twin", "kobuki")
NAMES = [pytest.param(name, marks=[pytest.mark.realtime] * (name in REAL_TIME)) for name in STAGES]


@pytest.fixture(params=NAMES)
def closed(request):
    with STAGES[request.param]() as stage:
        yield stage


@pytest.fixture
def stage(closed):
    with ExitStack() as stack:
        stack.enter_context(closed.base)
        yield closed.ready()


def test_each_base_is_tried_here():
    assert STAGES.keys() == BASES.keys()
    assert SIMULATED_BASES == SIMULATED


def test_its_name_and_abilities_are_its_own(closed):
    base = closed.base
    assert isinstance(base, BASES[base.name])
    # No program arms a real one, and none runs on our clock.
    assert base.abilities.simulated == (base.name not in ("kobuki", "rosbridge"))
    assert base.abilities.simulated or base.abilities.real_time
    assert base.abilities.moves or not base.abilities.bumpers


def test_a_base_that_is_not_open_stops_shows_and_answers_without_complaint(closed):
    base = closed.base
    base.stop()
    for indication in Indication:
        base.show(indication, aloud=True)
    base.answer(Answer("celebrate", is_glad=True))
    assert base.problem == ""


def test_it_begins_at_home_and_still(stage):
    there = stage.base.read()
    assert there.pose.distance_m(HOME) < 1e-3
    assert is_still(there)
    assert there.sensors.hazards == frozenset()
    assert there.sensors.refusal == ""
    assert there.sensors.silent_s < 0.2


def test_it_says_what_was_really_ordered_and_goes_there(stage):
    sent = stage.drive(Twist(9, 0), TAKES_S)
    assert 0 < abs(sent.v_m_s) <= CEILING_M_S or not stage.base.abilities.moves
    assert abs(sent.w_rad_s) <= CEILING_RAD_S
    assert stage.base.abilities.moves == (not sent.is_still)
    x_m = stage.base.read().pose.x_m
    assert 0.02 < x_m < 2 * TAKES_S * CEILING_M_S or not stage.base.abilities.moves


def test_left_is_counter_clockwise(stage):
    stage.drive(Twist(0, 1.0), TAKES_S)
    heading_rad = stage.base.read().pose.heading_rad
    assert heading_rad > 0.05 or not stage.base.abilities.moves


@pytest.mark.parametrize("bad", [Twist(math.nan, 0), Twist(0.1, math.inf)], ids=["nan", "inf"])
def test_an_order_that_is_not_finite_stops_it(stage, bad):
    stage.drive(Twist(0.1, 0), 0.2)
    assert stage.drive(bad, TAKES_S) == STILL
    assert is_still(stage.base.read())


def test_an_order_grows_old(stage):
    stage.drive(Twist(0.1, 0.2), 0.2)
    stage.clock.wait(ORDER_HOLDS_S + TAKES_S)
    there = stage.base.read().pose
    stage.clock.wait(0.3)
    assert stage.base.read().pose.distance_m(there) < 0.002
    assert there.distance_m(HOME) < 0.1 * (0.2 + ORDER_HOLDS_S + 2 * TAKES_S)


def test_stopping_stops_where_it_is(stage):
    stage.drive(Twist(0.1, 0), 0.2)
    stage.base.stop()
    stage.clock.wait(TAKES_S)
    there = stage.base.read().pose
    stage.base.stop()
    stage.clock.wait(0.2)
    assert stage.base.read().pose.distance_m(there) < 0.002


def test_home_is_where_it_is_put(stage):
    stage.drive(Twist(0.1, 0.5), 0.2)
    stage.drive(STILL, TAKES_S)
    stage.base.set_home()
    assert stage.base.read().pose.distance_m(HOME) < 0.002


def test_it_shows_and_answers_anything_while_it_moves(stage):
    for indication in Indication:
        stage.drive(Twist(0.05, 0), 0.04)
        stage.base.show(indication, aloud=True)
        stage.base.answer(Answer("droop", is_glad=False, is_quiet=True))
    assert stage.base.read().sensors.silent_s < 0.2
    assert all(isinstance(count, int) for count in stage.base.counters.values())


def test_leaving_it_stops_it(closed):
    with closed.base as base:
        closed.ready().drive(Twist(0.1, 0), 0.2)
    there = base.ground_truth() if base.name == "kinematic" else None
    closed.clock.wait(1.0)
    assert there is None or base.ground_truth() == there
    base.stop()  # again, when it is closed


def test_a_clock_that_goes_back_moves_nothing():
    clock = Clock()
    base = IdealBase(clock)
    base.drive(Twist(0.1, 0))
    clock.now_s -= 10
    assert base.read().pose == HOME


def test_the_kinematic_base_does_what_it_is_told():
    clock, expected = Clock(), HOME
    base = IdealBase(clock)
    for number in range(50):
        twist = Twist(0.1 + number / 1000, 0.5 - number / 50)
        base.drive(twist)
        clock.now_s += 0.02
        expected = advance(expected, twist, 0.02)
    there = base.read().pose
    assert there.distance_m(expected) < 1e-9
    assert there.heading_rad == pytest.approx(expected.heading_rad)
    assert isinstance(there, Pose)


def test_an_ordinary_base_is_late_and_gradual():
    clock, seen = Clock(), []
    base = KinematicBase(clock)
    for _ in range(40):
        base.drive(Twist(0.1, 0))
        seen.append(base.read().twist.v_m_s)
        clock.now_s += 0.02
    begun = next(tick for tick, v_m_s in enumerate(seen) if v_m_s > 0.005)
    half = next(tick for tick, v_m_s in enumerate(seen) if v_m_s > 0.05)
    assert begun * 0.02 == pytest.approx(0.2, abs=0.03)
    assert 0.02 <= (half - begun) * 0.02 <= 0.06
    assert seen[-1] == pytest.approx(0.1)


def test_an_ordinary_base_sticks_at_the_smallest_orders():
    clock = Clock()
    base = KinematicBase(clock)
    for _ in range(50):
        base.drive(Twist(0.007, 0))
        clock.now_s += 0.02
    assert base.ground_truth().pose == HOME


@pytest.mark.parametrize("held", [1.0, 0.5])
def test_a_base_that_is_held_pushes(held):
    clock = Clock()
    base = KinematicBase(clock)
    for share, push_n in ((0.0, 2.0), (held, 57 * held)):
        base.held = share
        for _ in range(40):
            base.drive(Twist(0.1, 0))
            clock.now_s += 0.02
        there = base.read()
        assert there.sensors.push_n == pytest.approx(push_n, abs=2)
        assert there.twist.v_m_s <= 0.1 * (1 - share) + 1e-9
