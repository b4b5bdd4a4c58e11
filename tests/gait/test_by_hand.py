"""Parts of the gait code against numbers that are known by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rehab.gait.contacts.drag import find_edge
from rehab.gait.selfcheck.unloaded import find_moment_zero, find_other_load
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.signals.samples import CHANNEL_NAMES
from rehab.gait.stances.limb import (
    find_belt_speed,
    find_knee_flexion,
    find_margin,
    find_trailing_limb,
)
from rehab.gait.stances.resampling import Resampler, decimate

RATE_HZ = 100.0


def fill(count=200, **rows):
    """Return the buffers of two legs with channels by name, one for each leg or both, else NaN."""
    buffer = SampleBuffer(1000, legs=2)
    table = np.full((len(buffer.layout.order), count), np.nan)
    middle = buffer.layout.time_rows[len(table)]
    table[middle] = np.arange(count) / RATE_HZ
    for name, values in rows.items():
        place = 1 + CHANNEL_NAMES.index(name)
        table[middle - place], table[middle + place] = np.broadcast_to(values, (2, count))
    buffer.append(table)
    return buffer.legs


def walk_by_hand(count=200):
    """Return legs whose feet a belt carries back at 0.8 m/s while they are flat, else faster.

    The stance is 20:80, of which 32:48 are flat; the next contact is at 150, the swing 100:160.
    """
    n = np.arange(count)
    t_s = n / RATE_HZ
    speed = np.where((n >= 32) & (n < 47), 0.8, 2.0)
    foot = 0.3 - np.concatenate(([0], np.cumsum(speed[:-1]))) / RATE_HZ
    hip = 0.1 * t_s + 40 * (t_s - 1.5) ** 3 * (n > 100)
    ahead = np.where((n >= 50) & (n < 80), 0.9 * t_s - 0.3, 3.0)  # of the foot, in late stance
    hip = np.where(n < 100, foot + ahead, hip)
    knee = np.radians(np.where((n >= 100) & (n < 160), 10 + 50 * np.sin((n - 100) / 20), 99))
    return fill(
        count,
        position_m=foot,
        foot_up_m=0.1,
        hip_forward_m=np.array([hip, hip + 0.2 * (n > 100)]),
        hip_up_m=np.array([0.9 + n / 1000, 0.8 + n / 1000]),
        knee_angle_rad=knee,
    )


def test_a_leg_by_hand():
    left, right = walk_by_hand()
    assert find_belt_speed(left, 20, 80) == pytest.approx(0.8)
    # The last three samples of the stance's second half.
    last = [math.degrees(math.atan2(0.009 * n - 0.3, 0.8 + n / 1000)) for n in (77, 78, 79)]
    assert find_trailing_limb(left, 20, 80, RATE_HZ) == pytest.approx(np.mean(last))
    top = [10 + 50 * math.sin(n / 20) for n in (30, 31, 32)]
    assert find_knee_flexion(left, 100, 160, RATE_HZ) == pytest.approx(np.mean(top))
    # At 1.5 s the hips are at 0.15 and 0.35 m; their velocity is that of 13 samples around it.
    around_s = np.arange(-6, 7) / RATE_HZ
    velocity = np.polyfit(around_s, 0.1 * around_s + 40 * around_s**3, 1)[0]
    expected = 0.25 + (velocity + 0.8) * math.sqrt((1.05 + 0.95) / 2 / 9.81) + 0.1
    assert find_margin((left, right), 150, -0.1, 0.8, RATE_HZ) == pytest.approx(expected)


def test_a_few_samples_are_enough():
    left, _ = walk_by_hand()
    assert find_knee_flexion(left, 100, 103, RATE_HZ) is None
    assert find_trailing_limb(left, 60, 63, RATE_HZ) is None
    assert find_knee_flexion(left, 100, 104, RATE_HZ) is not None
    assert find_trailing_limb(left, 60, 64, RATE_HZ) is not None
    assert find_belt_speed(left, 32, 38) is None
    assert find_belt_speed(left, 32, 40) == pytest.approx(0.8)


def test_what_is_missing_is_not_measured():
    left, right = fill()
    assert find_belt_speed(left, 0, 60) is None
    assert find_trailing_limb(left, 0, 60, RATE_HZ) is None
    assert find_knee_flexion(left, 0, 60, RATE_HZ) is None
    assert find_margin((left, right), 50, 0.0, 0.8, RATE_HZ) is None


def strides_of(count, *, side="left", a2_moment=1.0, is_valid=True):
    """Return strides of a second each: 0.4 s of swing, then 0.6 s of stance."""
    return [
        SimpleNamespace(
            side=side, valid=is_valid, initial_contact_s=n + 0.4, swing_s=0.4, stance_s=0.6,
            a2_moment_nm_kg=a2_moment,
        )
        for n in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("rest_nm_kg", "said", "waits"),
    [(-0.04, None, False), (0.025, None, False), (-0.05, "-8%", False), (0.035, "+9%", False),
     (-0.07, "-12%", True), (0.05, "+12%", True)],
)  # fmt: skip
def test_a_moment_that_does_not_rest(rest_nm_kg, said, waits):
    """In the middle half of swing; a moment of 0.5 Nm/kg at A2."""
    t_s = np.arange(1200) / RATE_HZ
    is_middle = (t_s % 1.0 > 0.095) & (t_s % 1.0 < 0.305)
    moment = np.where(is_middle, 70.0 * rest_nm_kg, 50.0)
    strides = [*strides_of(12, a2_moment=0.5), *strides_of(12, is_valid=False, a2_moment=9.0)]
    found = find_moment_zero(t_s, moment, strides, 70.0)
    assert (found is None) == (said is None)
    if found is not None:
        assert f"{70 * rest_nm_kg:.1f} Nm while the foot swings" in found[0]
        assert f"about {said}." in found[0]
        assert found[1] == waits


def test_few_strides_and_missing_samples_tell_nothing():
    t_s = np.arange(1200) / RATE_HZ
    moment = np.full(1200, 30.0)
    assert find_moment_zero(t_s, moment, strides_of(4), 70.0) is None
    assert find_moment_zero(t_s, moment, strides_of(5), 70.0) is not None
    assert find_moment_zero(t_s, moment * np.nan, strides_of(12), 70.0) is None
    assert find_other_load(t_s, moment, [], 0.0, 700.0) is None


@pytest.mark.parametrize(
    ("load_n", "said", "waits"), [(44.0, None, False), (45.0, "5%", False), (85.0, "11%", True)]
)
def test_a_plate_that_is_loaded_while_the_other_foot_stands_alone(load_n, said, waits):
    """Above a zero of 8 N, by a weight of 700 N; before and after single support is no matter."""
    t_s = np.arange(1200) / RATE_HZ
    share = ((t_s % 1.0) - 0.4) / 0.6
    force = np.where((share > 0.39) & (share < 0.61), load_n, 600.0)
    found = find_other_load(t_s, force, strides_of(12), 8.0 if said else 10.0, 700.0)
    assert (found is None) == (said is None)
    if found is not None:
        assert f"While the left foot stands alone, the other plate carries {said}" in found[0]
        assert found[1] == waits


def test_neighbors_are_averaged_from_the_end():
    rows = np.array([[9.0, 1, 2, 3, 4, 5, 6]])
    assert decimate(rows, 1) is rows
    assert decimate(rows, 3).tolist() == [[2.0, 5.0]]
    assert decimate(rows, 4) is None


def test_a_stance_at_even_times_by_hand():
    t_s = np.array([0.0, 0.011, 0.02, *np.arange(3, 31) / 100])
    window = np.array([t_s, 100 * t_s, 10 * t_s, t_s])
    stance = Resampler(RATE_HZ, 2.0).resample(window, 0.105, 0.295)
    assert (stance.begin, stance.end, len(stance.signals[0])) == (11, 29, 31)
    assert stance.first_s == pytest.approx(0.0)
    assert stance.signals[:, 20] == pytest.approx([20.0, 2.0, 0.2])
    assert (stance.index(0.0), stance.index(0.5), stance.index(2.0)) == (11, 20, 29)
    late = Resampler(RATE_HZ, 2.0).resample(window, 0.105, 0.295, t_s - 0.01)
    assert late.signals[:, 10] == pytest.approx([10.0, 1.1, 0.11])
    assert Resampler(RATE_HZ, 2.0).resample(window, 0.105, 0.185) is None


def test_the_edge_of_a_drag_by_hand():
    """It unloads by 1 N/ms to a drag of 50 N, which would hide 20 N + 0.4 × 50 N at 60 ms more."""
    time_ms = np.arange(300.0)
    force = np.maximum(200 - time_ms, 50.0)
    edge = find_edge(force, 1000.0, 0.0, 20.0, 8.0)
    assert edge == pytest.approx(160, abs=6)
    assert find_edge(force + 30, 1000.0, 30.0, 20.0, 8.0) == pytest.approx(edge, abs=1)
    assert find_edge(200 - time_ms[:150], 1000.0, 0.0, 20.0, 8.0) is None
    assert find_edge(np.full(40, 50.0), 1000.0, 0.0, 20.0, 8.0) is None
    assert find_edge(force, 1000.0, 0.0, 20.0, 60.0) is None
