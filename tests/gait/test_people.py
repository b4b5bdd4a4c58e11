"""On synthetic people of all weights and paces, measured by labs of all kinds."""

import tracemalloc

import numpy as np
import pytest

from rehab.gait import Flag, LegSamples, StrideDetector, TwoLegDetector
from tests.gait.walks import CLEAN, FORCE, filter_offline, make_walk, pair_up

pytestmark = pytest.mark.matrix

SIDES = ("left", "right")
PEOPLE = {
    "usual": {},
    "fast": {"stride_s": 0.9, "a2_w_kg": 5.0},
    "slow": {"stride_s": 1.6, "a2_w_kg": 1.0},
    "after a stroke": {"stride_s": 2.2, "a2_w_kg": 0.3, "mass_kg": 60.0, "other_a2_w_kg": 1.5},
    "child": {"mass_kg": 22.0, "stride_s": 0.95},
    "heavy": {"mass_kg": 150.0},
    "strong": {"a2_w_kg": 6.5},
}


def check(walk, truth, clean, look_ahead_s, mean_error, contact_s=0.01):
    found = [s for s in walk.both_legs(look_ahead_s=look_ahead_s) if s.side == "left"]
    pairs = pair_up(found, [stride.initial_contact_s for stride in truth])
    assert None not in pairs
    assert len(found) == len(truth)
    begins = [s.initial_contact_s - t.initial_contact_s for s, t in zip(pairs, truth, strict=True)]
    ends = [s.terminal_contact_s - t.terminal_contact_s for s, t in zip(pairs, truth, strict=True)]
    assert abs(np.mean(begins)) < contact_s
    assert abs(np.mean(ends)) < contact_s
    assert all(stride.valid for stride in pairs), [s.reasons for s in pairs if not s.valid]
    expected = np.array(filter_offline(clean, truth))
    errors = np.abs(np.array([stride.a2_w_kg for stride in pairs]) - expected)
    errors /= np.maximum(expected, 0.5)  # of the weakest, the sensors' noise makes 1 %
    assert errors.mean() < mean_error
    assert np.percentile(errors, 95) < 2 * mean_error


@pytest.mark.parametrize(("look_ahead_s", "error"), [(0.0, 0.025), (0.05, 0.01)])
@pytest.mark.parametrize("who", PEOPLE)
@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_people(who, rate_hz, look_ahead_s, error):
    walk, truth = make_walk(rate_hz=rate_hz, **PEOPLE[who])
    clean, _ = make_walk(**PEOPLE[who], **CLEAN)
    # 20 N are a tenth of a child's weight, and of a slow walker's they take longer to build up.
    check(walk, truth, clean, look_ahead_s, error, contact_s=0.02)


@pytest.mark.parametrize("rate_hz", [50, 100, 148.1, 250, 500, 1000, 2000])
def test_rates(rate_hz):
    walk, truth = make_walk(rate_hz=rate_hz)
    clean, _ = make_walk(**CLEAN)
    check(walk, truth, clean, 0.05, 0.01)


@pytest.mark.parametrize("noise", [0.5, 3.0])
@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_noise(noise, rate_hz):
    walk, truth = make_walk(
        rate_hz=rate_hz,
        force_noise_n=4 * noise,
        moment_noise_nm=0.5 * noise,
        angle_noise_rad=0.001 * noise,
    )
    clean, _ = make_walk(**CLEAN)
    check(walk, truth, clean, 0.05, 0.015, contact_s=0.015)


@pytest.mark.parametrize("drift", [-60.0, 60.0])
def test_a_drifting_plate_is_followed(drift):
    walk, truth = make_walk(rate_hz=500, force_drift_n_min=drift, strides=60)
    clean, _ = make_walk(strides=60, **CLEAN)
    check(walk, truth, clean, 0.05, 0.01)
    assert Flag.OFFSET in walk.one_leg()[-1].flags


def test_a_plate_zeroed_wrongly_costs_the_first_steps_only():
    walk, truth = make_walk(rate_hz=500, force_offset_n=60.0)
    found = walk.one_leg()

    assert len(truth) - len(found) <= 3
    assert found[-1].offset_n == pytest.approx(60, abs=2)
    assert found[-1].initial_contact_s == pytest.approx(truth[-1].initial_contact_s, abs=0.01)


def test_propulsion_and_position():
    walk, _ = make_walk(rate_hz=200)
    forward = np.where(walk.left[FORCE] > 100, 90.0, 0.0)
    position = 0.1 * walk.t_s
    detector = StrideDetector(200, 75.0)
    force, moment, angle = walk.left
    found = detector.feed(walk.t_s, force, moment, angle, forward, position)

    assert found[3].propulsion_n_kg == pytest.approx(90 / 75, rel=0.15)
    assert found[3].position_m == pytest.approx(0.1 * found[3].initial_contact_s, abs=1e-9)


def test_step_length_and_symmetry():
    walk, _ = make_walk(rate_hz=200)
    count = len(walk.t_s)
    left = LegSamples(*walk.left)._replace(position_m=np.full(count, 0.3))
    right = LegSamples(*walk.right)._replace(position_m=np.full(count, -0.1))
    strides = TwoLegDetector(200, 75.0).feed(walk.t_s, left, right)

    left_step, right_step = (next(s for s in strides[4:] if s.side == side) for side in SIDES)
    assert left_step.step_length_m == pytest.approx(0.4)
    assert right_step.step_length_m == pytest.approx(-0.4)
    assert left_step.step_s == pytest.approx(0.55, abs=0.05)


@pytest.mark.long
@pytest.mark.parametrize("look_ahead_s", [0.0, 0.05])
@pytest.mark.parametrize("size", [7, 50, 999])
def test_the_same_in_any_chunks(size, look_ahead_s):
    """At 1 kHz, where a stance is averaged down and the buffer moves at other samples."""
    walk, _ = make_walk(rate_hz=1000, strides=30)
    strides = walk.in_chunks(size, look_ahead_s=look_ahead_s)

    assert sum(stride.valid for stride in strides) > 50
    assert strides == walk.both_legs(look_ahead_s=look_ahead_s)


def test_memory_stays_as_it_is():
    walk, _ = make_walk(rate_hz=500)
    span = walk.t_s[-1] + 0.002
    detector = StrideDetector(500, 75.0)
    sizes = []
    tracemalloc.start()
    for lap in range(20):
        detector.feed(walk.t_s + lap * span, *walk.left)
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()

    assert sizes[-1] < sizes[2] + 20_000
