"""Parts of the gait code against numbers that are known by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rehab.gait.contacts.drag import find_edge
from rehab.gait.selfcheck.unloaded import find_moment_zero, find_other_load
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.stances.limb import (
    find_belt_speed,
    find_knee_flexion,
    find_margin,
    find_trailing_limb,
)
from rehab.gait.stances.resampling import Resampler, decimate

RATE_HZ = 100.0


def fill(count=200, **rows):
    """Return the buffers of two legs with channels by their place in ``LegSamples``, else NaN."""
    buffer = SampleBuffer(1000, legs=2)
    table = np.full((len(buffer.layout.order), count), np.nan)
    middle = buffer.layout.time_rows[len(table)]
    table[middle] = np.arange(count) / RATE_HZ
    for name, values in rows.items():
        for row in (middle - int(name[1:]), middle + int(name[1:])):
            table[row] = values
    buffer.append(table)
    return buffer.legs


def walk_by_hand(count=200):
    """Return legs whose feet the belt carries back at 0.8 m/s, under hips that go on at 0.1."""
    t_s = np.arange(count) / RATE_HZ
    return fill(
        count,
        r5=0.3 - 0.8 * t_s,
        r6=np.full(count, 0.1),
        r7=0.1 * t_s,
        r8=np.full(count, 0.9),
        r9=np.radians(10 + 50 * np.sin(np.pi * t_s / 2)),
    )


def test_a_leg_by_hand():
    left, right = walk_by_hand()
    assert find_belt_speed(left, 0, 60) == pytest.approx(0.8)
    # The last three samples of the stance's second half: hip minus foot is 0.9 t - 0.3.
    last = [math.degrees(math.atan2(0.9 * n / RATE_HZ - 0.3, 0.8)) for n in (57, 58, 59)]
    assert find_trailing_limb(left, 0, 60, RATE_HZ) == pytest.approx(np.mean(last))
    assert find_knee_flexion(left, 0, 200, RATE_HZ) == pytest.approx(60, abs=0.02)
    # At 0.5 s: the hips are at 0.05 m, the foot at -0.1 m; 0.9 m/s by a pendulum of 0.9 m.
    expected = 0.05 + 0.9 * math.sqrt(0.9 / 9.81) + 0.1
    assert find_margin((left, right), 50, -0.1, 0.8, RATE_HZ) == pytest.approx(expected)


def test_what_is_missing_is_not_measured():
    left, right = fill()
    assert find_belt_speed(left, 0, 60) is None
    assert find_trailing_limb(left, 0, 60, RATE_HZ) is None
    assert find_knee_flexion(left, 0, 60, RATE_HZ) is None
    assert find_margin((left, right), 50, 0.0, 0.8, RATE_HZ) is None


def strides_of(count, *, side="left", a2_moment=1.0):
    """Return strides of a second each: 0.4 s of swing, then 0.6 s of stance."""
    return [
        SimpleNamespace(
            side=side, valid=True, initial_contact_s=n + 0.4, swing_s=0.4, stance_s=0.6,
            a2_moment_nm_kg=a2_moment,
        )
        for n in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("rest_nm_kg", "said", "waits"),
    [(-0.04, None, False), (0.025, None, False), (-0.05, "-4%", False), (0.04, "+5%", False),
     (-0.12, "-11%", True), (0.1, "+11%", True)],
)  # fmt: skip
def test_a_moment_that_does_not_rest(rest_nm_kg, said, waits):
    t_s = np.arange(1200) / RATE_HZ
    found = find_moment_zero(t_s, np.full(1200, 70.0 * rest_nm_kg), strides_of(12), 70.0)
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
