"""Gestures on a simulated floor: home at the end, within limits always, interruptible anywhere."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.motion.gesture import Gesture, Waypoint
from robot.motion.gesture_variants import VARIANTS
from robot.motion.gestures import GESTURES
from robot.motion.limits import TETHER_M, Limits
from robot.motion.player import BAD_ODOMETRY, DONE, LATE_PACE, OUT_OF_TIME, Player
from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import STILL, Twist
from tests.support.extent import examples

each_gesture = pytest.mark.parametrize("gesture", GESTURES.values(), ids=lambda g: g.name)
gestures = st.sampled_from([*GESTURES.values(), *VARIANTS.values()])


class Floor:
    """A base on a floor: it does what it is told, times ``grip``, ``lag`` orders later."""

    def __init__(self, pose=HOME, grip=(1.0, 1.0), lag=0):
        self.pose, self.time_s, self.farthest_m = pose, 0.0, 0.0
        self.orders = [STILL] * (lag + 1)
        self.grip, self.lag = grip, lag

    def play(self, player, dt_s=0.02, until=lambda floor: False):
        """Order until the gesture ends."""
        while player.is_busy and not until(self):
            self.orders.append(player.step(self.time_s, self.pose))
            sent = self.orders[-1 - self.lag]
            v, w = self.grip
            real = Twist(sent.v_m_s * v, sent.w_rad_s * w, sent.vy_m_s * v)
            self.pose = advance(self.pose, real, dt_s)
            self.time_s += dt_s
            self.farthest_m = max(self.farthest_m, self.pose.distance_m(HOME))
            assert self.time_s < 60
        return self


def is_at_home(pose):
    return pose.distance_m(HOME) < 0.02 and pose.turn_rad(HOME) < math.radians(2)


@each_gesture
def test_a_gesture_is_over_in_about_3_s_and_ends_at_home(gesture):
    player, floor = Player(Limits()), Floor()
    player.start(gesture, 0.0, HOME)
    floor.play(player)
    assert player.outcome == DONE
    assert floor.time_s <= 3.0
    assert floor.farthest_m + abs(floor.pose.heading_rad) > 0  # something was to be seen
    assert is_at_home(floor.pose)
    assert floor.orders[-1] == STILL


@settings(max_examples=examples(60), deadline=None)
@given(
    gestures,
    st.floats(0.1, 1),
    st.sampled_from([0.01, 0.02, 0.025]),
    st.integers(0, 2),
    st.tuples(st.floats(0.9, 1.1), st.floats(0.9, 1.1)),
    st.floats(-0.04, 0.04),
    st.floats(-0.08, 0.08),
    st.integers(-3, 3),
)
def test_it_ends_at_home_whatever_the_floor(gesture, intensity, dt_s, lag, grip, x, turn, turns):
    """Orders that come late, wheels that slip, a start a little off, full turns made before."""
    player = Player(Limits())
    floor = Floor(Pose(x, x / 2, turn + turns * math.tau), grip, lag)
    player.start(gesture.scaled(intensity), 0.0, floor.pose)
    # A base that starts beside its home may come to turn on the spot beside it.
    floor.play(player, dt_s)
    assert player.outcome == DONE
    assert floor.farthest_m < TETHER_M
    assert floor.pose.turn_rad(HOME) < math.radians(2.5)
    if abs(x) < 0.001:
        assert floor.pose.distance_m(HOME) < 0.02


@settings(max_examples=examples(60), deadline=None)
@given(gestures, st.sampled_from([0.01, 0.02, 0.05]), st.floats(0.0, 4.0))
def test_every_order_keeps_the_limits_also_while_it_is_stopped(gesture, dt_s, stop_s):
    limits = Limits()
    player, floor = Player(limits), Floor()
    player.start(gesture, 0.0, HOME)
    floor.play(player, dt_s, until=lambda floor: floor.time_s >= stop_s)
    player.stop("paused")
    stopped_s = floor.time_s
    floor.play(player, dt_s)
    assert floor.time_s - stopped_s <= 0.5 + 2 * dt_s
    assert player.outcome in {"paused", DONE}
    for before, after in zip(floor.orders, floor.orders[1:], strict=False):
        assert abs(after.v_m_s) <= limits.v_m_s + 1e-12
        assert abs(after.w_rad_s) <= limits.w_rad_s + 1e-12
        assert abs(after.v_m_s - before.v_m_s) <= limits.slow_down_m_s2 * dt_s + 1e-9
        assert abs(after.w_rad_s - before.w_rad_s) <= limits.slow_down_rad_s2 * dt_s + 1e-9


def late(gesture, goes):
    """Play a gesture on a floor that takes from its speed on the way home."""
    player, floor = Player(Limits()), Floor()
    player.start(gesture, 0.0, HOME)
    floor.play(player, until=lambda _: player._waypoint is gesture.waypoints[-1])
    floor.grip = (goes, goes)
    return player, floor.play(player)


@pytest.mark.parametrize(
    ("goes", "is_late", "outcome"),
    [(0.6, False, DONE), (0.45, True, DONE), (0.1, False, OUT_OF_TIME)],
)
def test_a_small_miss_is_made_up_for_slowly(goes, is_late, outcome):
    player, floor = late(VARIANTS["near_miss_1"], goes)
    assert (player.outcome, player._is_late) == (outcome, is_late)
    if outcome == DONE:
        assert is_at_home(floor.pose)
        last = [order.w_rad_s for order in floor.orders[-25:] if not order.is_still]
        assert not is_late or max(map(abs, last)) <= LATE_PACE * Limits().w_rad_s


@each_gesture
def test_halting_orders_stillness_at_once(gesture):
    player, floor = Player(Limits()), Floor()
    player.start(gesture, 0.0, HOME)
    floor.play(player, until=lambda floor: floor.time_s > 0.5)
    assert not floor.orders[-1].is_still
    player.halt("stopped")
    assert player.twist == STILL
    assert player.step(floor.time_s, floor.pose) == STILL
    assert (player.is_busy, player.outcome) == (False, "stopped")


def test_a_base_that_is_held_gives_up_in_time():
    player, floor = Player(Limits()), Floor(grip=(0.0, 1.0))
    player.start(GESTURES["celebrate"], 0.0, HOME)
    floor.play(player)
    assert player.outcome == OUT_OF_TIME
    assert floor.time_s < 1.6 + 0.6
    assert floor.orders[-1] == STILL


@pytest.mark.parametrize("pose", [Pose(math.nan), Pose(0, math.inf), Pose(0, 0, -math.inf)])
def test_odometry_that_is_not_finite_halts(pose):
    player, floor = Player(Limits()), Floor()
    player.start(GESTURES["celebrate"], 0.0, HOME)
    floor.play(player, until=lambda floor: floor.time_s > 0.5)
    assert player.step(floor.time_s, pose) == STILL
    assert (player.is_busy, player.outcome) == (False, BAD_ODOMETRY)


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=50))
def test_no_clock_makes_it_lurch(times):
    player = Player(Limits())
    player.start(GESTURES["celebrate"], 0.0, HOME)
    before = STILL
    for time_s in times:
        after = player.step(time_s, HOME)
        assert abs(after.v_m_s - before.v_m_s) <= 0.5 * 0.1 + 1e-9
        before = after


def test_one_gesture_at_a_time():
    player = Player(Limits())
    player.start(GESTURES["nod"], 0.0, HOME)
    with pytest.raises(RuntimeError, match="nod is being played"):
        player.start(GESTURES["nod"], 0.1, HOME)


def test_it_stays_where_it_is_told_to():
    hold = Gesture(
        "wait",
        "Wait",
        (Waypoint(0.1, 0, 0, within_s=5, hold_s=2), Waypoint(0, 0, 0, within_s=3)),
    )
    player, floor = Player(Limits()), Floor()
    player.start(hold, 0.0, HOME)
    floor.play(player)
    assert player.outcome == DONE
    still = sum(order.is_still for order in floor.orders)
    assert 1.6 < still * 0.02 < 2.2


@pytest.mark.parametrize("beside_m", [0.03, -0.045])
def test_only_a_holonomic_base_corrects_what_it_is_beside_home(beside_m):
    ends = {}
    for is_holonomic in (False, True):
        player = Player(Limits(), is_holonomic=is_holonomic)
        floor = Floor(Pose(0.0, beside_m, 0.0))
        player.start(VARIANTS["joy_1"], 0.0, floor.pose)
        floor.play(player)
        assert player.outcome == DONE
        sideways = {order.vy_m_s for order in floor.orders}
        assert (sideways != {0.0}) == is_holonomic
        ends[is_holonomic] = floor.pose.distance_m(HOME)
    assert ends[False] == pytest.approx(abs(beside_m))
    assert ends[True] < 0.005


@each_gesture
def test_a_holonomic_base_keeps_its_heading_where_it_is_set_aside_on_its_way(gesture):
    player, floor = Player(Limits(), is_holonomic=True), Floor(lag=2)
    player.start(gesture, 0.0, HOME)
    floor.play(player, until=lambda floor: floor.time_s > 1.0)
    floor.pose = replace(floor.pose, y_m=floor.pose.y_m + 0.02)  # on a rug, say
    floor.play(player)
    assert player.outcome == DONE
    assert is_at_home(floor.pose)
