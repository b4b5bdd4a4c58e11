"""Each A2 says how uncertain it is, and is as often as far off as that."""

import numpy as np
import pytest

from tests.gait.walks import ANGLE, MOMENT, make_walk, pair_up, read_moore

pytestmark = pytest.mark.matrix

CLEAN = {"moment_noise_nm": 0.0, "angle_noise_rad": 0.0, "force_noise_n": 0.0, "jitter_s": 0.0}


def compare(found, truth):
    """Return errors of A2 by its stated standard deviation, and these by A2."""
    pairs = pair_up(found, [s.initial_contact_s for s in truth])
    both = [
        (one, other)
        for one, other in zip(pairs, truth, strict=True)
        if one is not None and one.valid
    ]
    assert len(both) > 20
    errors = np.array([(one.a2_w_kg - other.a2_w_kg) / one.a2_sd_w_kg for one, other in both])
    return errors, np.array([one.a2_sd_w_kg / one.a2_w_kg for one, _ in both])


@pytest.mark.parametrize("rate_hz", [100, 200])
@pytest.mark.parametrize("size", [1.0, 3.0])
def test_noise(rate_hz, size):
    walk, _ = make_walk(rate_hz=rate_hz, **CLEAN)
    rng = np.random.default_rng(1)
    noisy = walk
    for row, sd in ((MOMENT, 0.7 * size), (ANGLE, 0.002 * size)):
        noisy = noisy.change(row, lambda x, sd=sd: x + rng.normal(0, sd, len(x)))
    truth = [s for s in walk.both_legs() if s.side == "left" and s.valid]
    errors, shares = compare([s for s in noisy.both_legs() if s.side == "left"], truth)

    assert np.mean(np.abs(errors) < 2) >= 0.9
    assert np.abs(errors).mean() > 0.3  # it is not overstated much
    assert shares.mean() < 0.02 * size


@pytest.mark.parametrize(("look_ahead_s", "usual"), [(0.0, 0.0125), (0.05, 0.0025)])
def test_look_ahead(look_ahead_s, usual):
    walk, _ = read_moore()
    truth = [s for s in walk.both_legs(look_ahead_s=0.15) if s.valid and s.side == "left"]
    found = [s for s in walk.both_legs(look_ahead_s=look_ahead_s) if s.side == "left"]
    errors, shares = compare(found, truth)

    assert np.mean(np.abs(errors) < 2) >= 0.9
    assert np.median(shares) == pytest.approx(usual, rel=0.5)
