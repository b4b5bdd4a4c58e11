"""What every base promises, as tests: `pytest --garry` tries each installed plug-in.

Simulated bases are tried as they are. For a real one, subclass ``BaseContract`` in a test of your
own, with a fixture ``closed`` that yields a ``Stage`` with your base and a fake of its hardware.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import pytest

from robot.bases import BASES, Answer, Indication
from robot.motion.gestures import GESTURES
from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, ORDER_HOLDS_S, TICK_S
from robot.motion.pose import HOME
from robot.motion.twist import STILL, Twist

TAKES_S = 0.8  # an order to the wheels of a late base and back, on a busy machine
PLUGINS = [*BASES.plugins, *GESTURES.plugins]
SIMULATED = [name for name in BASES if BASES.find_plugin(name) and BASES[name].abilities.simulated]


class Clock:
    """A clock that is told the time."""

    def __init__(self) -> None:
        self.now_s = 50.0

    def __call__(self) -> float:
        """Return the time [s]."""
        return self.now_s

    def wait(self, span_s: float) -> None:
        """Let time pass [s]."""
        self.now_s += span_s


class RealClock:
    """The computer's."""

    def __call__(self) -> float:
        """Return the time [s]."""
        return time.monotonic()

    def wait(self, span_s: float) -> None:
        """Let time pass [s]."""
        time.sleep(span_s)


class Stage:
    """A base, open or not, with its clock."""

    def __init__(self, base: Any, clock: Any) -> None:
        self.base, self.clock = base, clock

    def drive(self, twist: Twist, for_s: float) -> Twist:
        """Order a twist 50 times a second, and return what was really ordered last."""
        ordered = STILL
        for _ in range(round(for_s / TICK_S)):
            ordered = self.base.drive(twist)
            self.clock.wait(TICK_S)
        return ordered

    def ready(self) -> Stage:
        """Order it to stand until it may be ordered to move."""
        if not isinstance(self.clock, Clock):
            self.drive(STILL, 0.2)
        return self


def is_still(there: Any) -> bool:
    """Whether a base stands, as far as its sensors tell."""
    twist = there.twist
    return bool(twist.speed_m_s < 0.003 and abs(twist.w_rad_s) < 0.02)


class BaseContract:
    """What holds for every base. Subclasses have a fixture ``closed``: a stage that is not open."""

    @pytest.fixture
    def stage(self, closed: Stage) -> Iterator[Stage]:
        """Yield the stage with its base open."""
        with closed.base:
            yield closed.ready()

    def test_its_name_and_abilities_are_its_own(self, closed: Stage) -> None:
        base = closed.base
        assert isinstance(base, BASES[base.name])
        assert base.abilities.simulated or base.abilities.real_time  # no real one runs on our clock
        assert base.abilities.moves or not base.abilities.bumpers

    def test_closed_it_stops_shows_and_answers_without_complaint(self, closed: Stage) -> None:
        base = closed.base
        base.stop()
        for indication in Indication:
            base.show(indication, aloud=True)
        base.answer(Answer("celebrate", is_glad=True))
        assert base.problem == ""

    def test_it_begins_at_home_and_still(self, stage: Stage) -> None:
        there = stage.base.read()
        assert there.pose.distance_m(HOME) < 1e-3
        assert is_still(there)
        assert there.sensors.hazards == frozenset()
        assert there.sensors.refusal == ""
        assert there.sensors.silent_s < 0.2

    def test_it_says_what_was_really_ordered_and_goes_there(self, stage: Stage) -> None:
        sent = stage.drive(Twist(9, 0), TAKES_S)
        assert 0 < abs(sent.v_m_s) <= CEILING_M_S or not stage.base.abilities.moves
        assert abs(sent.w_rad_s) <= CEILING_RAD_S
        assert stage.base.abilities.moves == (not sent.is_still)
        x_m = stage.base.read().pose.x_m
        assert 0.02 < x_m < 2 * TAKES_S * CEILING_M_S or not stage.base.abilities.moves

    def test_left_is_counter_clockwise(self, stage: Stage) -> None:
        stage.drive(Twist(0, 1.0), TAKES_S)
        heading_rad = stage.base.read().pose.heading_rad
        assert heading_rad > 0.05 or not stage.base.abilities.moves

    def test_to_the_left_it_moves_or_refuses_to(self, stage: Stage) -> None:
        base, aside = stage.base, Twist(0.0, 0.0, 0.1)
        if not base.abilities.holonomic:
            with pytest.raises(ValueError, match="sideways"):
                base.drive(aside)
            stage.drive(STILL, 0.2)
            assert base.read().pose.distance_m(HOME) < 1e-3
            return
        assert stage.drive(aside, TAKES_S).vy_m_s > 0.05
        there = base.read()
        assert there.pose.y_m > 0.02
        assert abs(there.pose.x_m) < there.pose.y_m / 4
        assert abs(there.pose.heading_rad) < 0.05
        assert there.twist.vy_m_s > 0.05
        stage.drive(STILL, TAKES_S)
        assert is_still(base.read())

    @pytest.mark.parametrize("bad", [Twist(math.nan, 0), Twist(0.1, math.inf)], ids=["nan", "inf"])
    def test_an_order_that_is_not_finite_stops_it(self, stage: Stage, bad: Twist) -> None:
        stage.drive(Twist(0.1, 0), 0.2)
        assert stage.drive(bad, TAKES_S) == STILL
        assert is_still(stage.base.read())

    def test_an_order_grows_old(self, stage: Stage) -> None:
        stage.drive(Twist(0.1, 0.2), 0.2)
        stage.clock.wait(ORDER_HOLDS_S + TAKES_S)
        there = stage.base.read().pose
        stage.clock.wait(0.3)
        assert stage.base.read().pose.distance_m(there) < 0.002
        assert there.distance_m(HOME) < 0.1 * (0.2 + ORDER_HOLDS_S + 2 * TAKES_S)

    def test_stopping_stops_where_it_is(self, stage: Stage) -> None:
        stage.drive(Twist(0.1, 0), 0.2)
        stage.base.stop()
        stage.clock.wait(TAKES_S)
        there = stage.base.read().pose
        stage.base.stop()
        stage.clock.wait(0.2)
        assert stage.base.read().pose.distance_m(there) < 0.002

    def test_home_is_where_it_is_put(self, stage: Stage) -> None:
        stage.drive(Twist(0.1, 0.5), 0.2)
        stage.drive(STILL, TAKES_S)
        stage.base.set_home()
        assert stage.base.read().pose.distance_m(HOME) < 0.002

    def test_it_shows_and_answers_anything_while_it_moves(self, stage: Stage) -> None:
        for indication in Indication:
            stage.drive(Twist(0.05, 0), 0.04)
            stage.base.show(indication, aloud=True)
            stage.base.answer(Answer("droop", is_glad=False, is_quiet=True))
        assert stage.base.read().sensors.silent_s < 0.2
        assert all(isinstance(count, int) for count in stage.base.counters.values())

    def test_leaving_it_stops_it(self, closed: Stage) -> None:
        with closed.base as base:
            closed.ready().drive(Twist(0.1, 0), 0.2)
        there = None if base.abilities.real_time else base.ground_truth()
        closed.clock.wait(1.0)
        assert there is None or base.ground_truth() == there
        base.stop()  # again, when it is closed


class TestPluginBases(BaseContract):
    """Each simulated base of an installed package."""

    @pytest.fixture(params=SIMULATED)
    def closed(self, request: pytest.FixtureRequest) -> Stage:
        """Return the base, not open, with the clock that it runs by."""
        base = BASES[request.param]
        clock = RealClock() if base.abilities.real_time else Clock()
        return Stage(base(clock), clock)


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda plugin: plugin.name)
def test_a_plug_in_can_be_used(plugin: Any) -> None:
    assert plugin.problem == ""
