"""Speeds and accelerations are kept whatever is wanted; arcs are exact."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, LONGEST_STEP_S, Limits, min_time_s
from robot.motion.pose import HOME, Pose, advance, wrap
from robot.motion.twist import STILL, Twist

anything = st.floats(allow_nan=True, allow_infinity=True)
speeds = st.floats(-2, 2)
limits = st.builds(
    Limits,
    v_m_s=st.floats(0.01, CEILING_M_S),
    w_rad_s=st.floats(0.1, CEILING_RAD_S),
    speed_up_m_s2=st.floats(0.1, 1),
    slow_down_m_s2=st.floats(0.1, 1),
    speed_up_rad_s2=st.floats(0.5, 5),
    slow_down_rad_s2=st.floats(0.5, 5),
)


aside = st.just(0.0) | anything


@given(limits, st.lists(st.tuples(anything, anything, aside, anything), max_size=30))
def test_every_order_keeps_the_limits(limit, wishes):
    now = STILL
    for v, w, vy, elapsed_s in wishes:
        after = limit.approach(now, Twist(v, w, vy), elapsed_s)
        assert after.is_finite
        assert after.speed_m_s <= limit.v_m_s * (1 + 1e-12)
        assert abs(after.w_rad_s) <= limit.w_rad_s * (1 + 1e-12)
        dt = min(max(elapsed_s, 0), LONGEST_STEP_S) if math.isfinite(elapsed_s) else 0
        most_m_s2 = max(limit.speed_up_m_s2, limit.slow_down_m_s2)
        most_rad_s2 = max(limit.speed_up_rad_s2, limit.slow_down_rad_s2)
        changed_m_s = math.hypot(after.v_m_s - now.v_m_s, after.vy_m_s - now.vy_m_s)
        assert changed_m_s <= most_m_s2 * dt + 1e-9
        assert abs(after.w_rad_s - now.w_rad_s) <= most_rad_s2 * dt + 1e-9
        if after.speed_m_s > now.speed_m_s + 1e-9:
            assert after.speed_m_s - now.speed_m_s <= limit.speed_up_m_s2 * dt + 1e-9
        now = after


@given(limits, speeds, speeds)
def test_clipping_keeps_the_curve_and_never_speeds_up(limit, v, w):
    clipped = limit.clip(Twist(v, w))
    assert clipped.v_m_s * w == pytest.approx(clipped.w_rad_s * v, abs=1e-12)
    assert abs(clipped.v_m_s) <= abs(v)
    assert v * clipped.v_m_s >= 0


@pytest.mark.parametrize(
    "bad",
    [Twist(math.nan, 0), Twist(0, math.inf), Twist(-math.inf, 1), Twist(0.1, 0, math.nan)],
)
def test_what_is_not_finite_stands_still(bad):
    assert Limits().clip(bad) == STILL


def test_slowing_down_stops_and_does_not_reverse():
    limit, now = Limits(), Twist(0.2, 1.5)
    for _ in range(25):  # 0.5 s: 0.2 / 0.5 and 1.5 / 3.5 are less
        now = limit.approach(now, STILL, 0.02)
    assert now == STILL


def test_turning_round_passes_through_stillness():
    limit, now, seen = Limits(), Twist(0.2, 0), []
    for _ in range(200):
        now = limit.approach(now, Twist(-0.2, 0), 0.02)
        seen.append(now.v_m_s)
    assert seen[-1] == -0.2
    assert 0 in seen


@pytest.mark.parametrize(
    "numbers",
    [
        {"v_m_s": 0.31},
        {"w_rad_s": 1.81},
        {"v_m_s": 0},
        {"w_rad_s": math.nan},
        {"speed_up_m_s2": 0},
        {"slow_down_rad_s2": math.inf},
    ],
)
def test_limits_have_limits(numbers):
    with pytest.raises(ValueError, match="above 0"):
        Limits(**numbers)


@pytest.mark.parametrize("share", [0, -1, 1.01, math.nan])
def test_no_share_of_the_limits_is_more_than_they_are(share):
    with pytest.raises(ValueError, match="share"):
        Limits().scaled(share)


@given(speeds, speeds, st.floats(0, 2), st.floats(-4, 4))
def test_one_long_arc_is_many_short_ones(v, w, elapsed_s, heading_rad):
    twist, start = Twist(v, w), Pose(0.1, -0.2, heading_rad)
    steps = start
    for _ in range(64):
        steps = advance(steps, twist, elapsed_s / 64)
    once = advance(start, twist, elapsed_s)
    assert once.distance_m(steps) < 1e-9
    assert once.heading_rad == pytest.approx(steps.heading_rad, abs=1e-9)


def test_a_quarter_circle():
    end = advance(HOME, Twist(math.pi / 2, math.pi / 2), 1.0)  # radius 1 m, to the left
    assert (end.x_m, end.y_m) == pytest.approx((1, 1))
    assert end.heading_rad == pytest.approx(math.pi / 2)


def test_directions_are_equal_after_full_turns():
    assert wrap(math.tau + 0.1) == pytest.approx(0.1)
    assert Pose(heading_rad=4 * math.pi).turn_rad(HOME) == pytest.approx(0)
    assert Pose(heading_rad=3).turn_rad(Pose(heading_rad=-3)) == pytest.approx(math.tau - 6)


@pytest.mark.parametrize(("distance", "time_s"), [(0.0, 0.0), (2.0, 3.0), (0.5, 1.0), (-2.0, 3.0)])
def test_the_shortest_time_of_a_trapezoid(distance, time_s):
    # To 1 at 2/s² and from there to 0 at 1/s² would take 1.5 s and cover 0.75.
    if abs(distance) == 0.5:
        time_s = math.sqrt(2 * 0.5 * (1 / 2 + 1 / 1))
    elif distance:
        time_s = 0.5 + 1 + (abs(distance) - 0.75)
    assert min_time_s(distance, 1.0, 2.0, 1.0) == pytest.approx(time_s)


def test_a_base_that_goes_sideways_faces_where_it_turns_to():
    beside = advance(HOME, Twist(0.0, 0.0, 0.1), 2.0)
    assert (beside.x_m, beside.y_m, beside.heading_rad) == pytest.approx((0.0, 0.2, 0.0))
    # A quarter turn to the left, always sideways to the left: a circle around what lies there.
    round_ = advance(HOME, Twist(0.0, math.pi / 2, 0.1), 1.0)
    radius_m = 0.1 / (math.pi / 2)
    assert (round_.x_m, round_.y_m) == pytest.approx((-radius_m, radius_m))


def test_two_wheels_have_no_speed_to_the_left():
    assert Twist(0.1, 0.0).wheels_m_s == (0.1, 0.1)
    with pytest.raises(ValueError, match="holonomic"):
        _ = Twist(0.1, 0.0, 0.01).wheels_m_s
