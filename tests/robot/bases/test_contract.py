"""What every base promises: a new one is added to ``STAGES``, and passes."""

from argparse import Namespace
from contextlib import contextmanager
from typing import Any

import pytest

from robot.bases import BASES
from robot.bases.kinematic import KinematicBase
from robot.motion.limits import TICK_S
from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import Twist
from robot.simulation import SIMULATED_BASES
from robot.testing import BaseContract, Clock, RealClock, Stage
from tests.support.fake_kobuki import FakeKobuki
from tests.support.robot_stage import IdealBase
from tests.support.ros_robots import RobotStage
from tests.support.rosbridge_stage import Stage as RosStage

SIMULATED = ["null", "kinematic"]


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


@contextmanager
def holonomic():
    clock = Clock()
    base = IdealBase(clock)
    base.configure(Namespace(port="", holonomic=True))
    yield Stage(base, clock)


@contextmanager
def robot(name):
    ros = RobotStage(name)
    ros.lose()
    base: Any = ros.base
    base.open, base.close = ros.open, lambda: None
    yield Stage(base, RosClock(ros))


STAGES: dict[str, Any] = {
    **{name: lambda name=name: simulated(name) for name in (*SIMULATED, "avatar")},
    "twin": twin,
    "kobuki": kobuki,
    "rosbridge": rosbridge,
}
# The same bases with other options.
VARIED: dict[str, Any] = {
    "holonomic": holonomic,
    "stretch": lambda: robot("stretch"),
    "quori": lambda: robot("quori"),
}
REAL_TIME = ("twin", "kobuki")
NAMES = [
    pytest.param(name, marks=[pytest.mark.realtime] * (name in REAL_TIME))
    for name in (*STAGES, *VARIED)
]


class TestBases(BaseContract):
    @pytest.fixture(params=NAMES)
    def closed(self, request):
        with (STAGES | VARIED)[request.param]() as stage:
            yield stage

    def test_no_program_arms_a_real_one(self, closed):
        base = closed.base
        assert base.abilities.simulated == (base.name not in ("kobuki", "rosbridge"))


def test_each_base_is_tried_here():
    assert STAGES.keys() == BASES.keys()
    assert SIMULATED_BASES == SIMULATED


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
