"""The sample clock: late samples are put back, lost ones found, all the same in any chunks."""

import numpy as np
import pytest

from rehab.gait.signals.clock import SampleClock, estimate_rate
from tests.gait.walks import read_moore

pytestmark = pytest.mark.matrix


def run(stamps, size=10**9):
    clock, times, late = SampleClock(), [], []
    for first in range(0, len(stamps), size):
        (part,), late_s = clock.add(np.array([stamps[first : first + size]]))
        times.append(part)
        late.append(np.zeros(len(part)) if late_s is None else late_s)
    held = clock.finish()
    if held is not None:
        times.append(held[0])
        late.append(np.zeros(len(held[0])))
    return np.concatenate(times), np.concatenate(late)


def even(rate_hz=100.0, seconds=20.0, jitter_s=0.0002, seed=0):
    count = int(rate_hz * seconds)
    return np.arange(count) / rate_hz + np.random.default_rng(seed).normal(0, jitter_s, count)


def stall(stamps, at, width_s, seed=0):
    rng = np.random.default_rng(seed)
    late, come_s = stamps.copy(), stamps[at] + width_s
    while at < len(late) and stamps[at] < come_s:
        late[at] = come_s
        come_s += rng.uniform(0.0003, min(0.001, 0.5 * (stamps[1] - stamps[0])))
        at += 1
    return late


@pytest.mark.parametrize("width_s", [0.02, 0.05, 0.082, 0.15, 0.24])
@pytest.mark.parametrize("rate_hz", [100, 148.1, 1000])
def test_late_samples_are_put_back(rate_hz, width_s):
    taken_s = even(rate_hz, jitter_s=0.02 / rate_hz)
    at = int(8.3 * rate_hz)
    times, late_s = run(stall(taken_s, at, width_s))

    assert np.abs(times - taken_s).max() < 0.001
    assert late_s[at] == pytest.approx(width_s, abs=0.001)
    assert not late_s[:at].any()


@pytest.mark.parametrize("width_s", [0.02, 0.06, 0.24, 3.0])
@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_lost_samples_leave_a_gap(rate_hz, width_s):
    taken_s = even(rate_hz)
    kept = (taken_s < 8.3) | (taken_s > 8.3 + width_s)
    times, late_s = run(taken_s[kept])

    assert np.abs(times - taken_s[kept]).max() < 0.002
    assert late_s.max() < 0.003
    assert np.diff(times).max() > width_s - 0.001


def test_a_loss_within_a_stall():
    """Half of what stalled was lost: the rest is late against the line after the loss."""
    stamps = stall(even(), 800, 0.1)
    stamps = np.delete(stamps, slice(801, 806))
    times, late_s = run(stamps)

    assert np.abs(times[806:] - stamps[806:]).max() < 0.001
    assert np.diff(times).max() == pytest.approx(0.06, abs=0.002)
    assert 0.03 < late_s.max() < 0.06


@pytest.mark.parametrize("jump_s", [-100.0, -0.5, 0.5, 100.0])
def test_a_clock_that_is_set_goes_on(jump_s):
    stamps = even()
    stamps[800:] += jump_s
    times, late_s = run(stamps)

    assert np.abs(times - stamps).max() < 0.002
    assert late_s.max() < 0.002


def test_moore_has_late_samples_and_no_lost_ones():
    stamps = read_moore()[0].t_s
    times, late_s = run(stamps)

    assert np.diff(stamps).max() > 0.13
    assert np.diff(times).max() < 0.015
    assert np.diff(times).min() > 0.005
    assert (late_s > 0.01).sum() > 40


@pytest.mark.parametrize("size", [1, 3, 7, 50, 1000])
@pytest.mark.parametrize("seed", range(5))
def test_the_same_in_any_chunks(size, seed):
    rng = np.random.default_rng(seed)
    stamps = even(seed=seed)
    for at in rng.integers(100, 1900, 12):
        stamps = stall(stamps, at, rng.uniform(0.01, 0.2))
    stamps = np.delete(stamps, rng.integers(0, len(stamps), 30))
    stamps[rng.integers(0, len(stamps), 3)] = np.nan
    whole, parts = run(stamps), run(stamps, size)

    assert np.array_equal(whole[0], parts[0], equal_nan=True)
    assert np.array_equal(whole[1], parts[1], equal_nan=True)
    assert len(whole[0]) == len(stamps)


def test_the_rate_by_the_times_that_are_usual():
    stamps = np.delete(stall(even(148.148), 300, 0.2), slice(900, 1000))
    assert estimate_rate(stamps) == pytest.approx(148.148, rel=1e-3)
