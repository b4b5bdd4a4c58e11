"""Synthetic patients as signals: what was asked for is in them."""

import numpy as np
import pytest

from rehab.sources.synthetic.profiles import PROFILES
from rehab.sources.synthetic.signals import GRAVITY_M_S2, Sensors
from rehab.sources.synthetic.walker import walk
from tests.support.synthetic_recordings import make_signals

QUIET = Sensors(rate_hz=1000, jitter_s=0, force_noise_n=0, moment_noise_nm=0, angle_noise_rad=0)


def power_of(leg, mass_kg):
    return leg.moment_nm / mass_kg * np.gradient(leg.angle_rad, 0.001)


@pytest.mark.parametrize("profile", ["good", "poor", "fatiguing"])
def test_power_peaks_at_the_a2_asked_for(profile):
    strides = list(walk(PROFILES[profile], 3, strides=40))
    made = make_signals(strides, 70, QUIET)
    power = power_of(made.left, 70)

    for stride in made.strides:
        if stride.side == "left" and stride.a2_w_kg is not None:
            first, last = np.searchsorted(
                made.t_s, (stride.initial_contact_s, stride.terminal_contact_s)
            )
            late = first + (last - first) * 6 // 10
            assert power[late:last].max() == pytest.approx(stride.a2_w_kg, rel=0.02)


def test_both_plates_carry_the_weight():
    made = make_signals(list(walk(strides=30)), 70, QUIET)
    walking = (made.t_s > 3) & (made.t_s < 25)
    load = (made.left.force_n + made.right.force_n)[walking]
    assert load.mean() == pytest.approx(70 * GRAVITY_M_S2, rel=0.02)


def test_strides_without_value_or_with_a_reason_look_it():
    strides = list(walk(PROFILES["dropout"], 5, strides=200))
    made = make_signals(strides, 70, QUIET)
    left = [stride for stride in made.strides if stride.side == "left"]

    assert [s.is_bad for s in left] == [bool(m.reasons) for m in strides]
    assert [s.a2_w_kg is None for s in left] == [m.value is None for m in strides]
    for stride in left:
        part = slice(
            *np.searchsorted(
                made.t_s, (stride.initial_contact_s + 0.01, stride.terminal_contact_s - 0.01)
            )
        )
        assert np.isnan(made.left.moment_nm[part]).any() == (stride.a2_w_kg is None)
        assert (made.left.force_n[part] == 0).any() == stride.is_bad


@pytest.mark.parametrize("rate_hz", [50, 100, 2000])
def test_sensors(rate_hz):
    sensors = Sensors(rate_hz=rate_hz, force_offset_n=20, force_drift_n_min=60, jitter_s=0.002)
    made = make_signals(list(walk(strides=20)), 70, sensors, seed=1)
    again = make_signals(list(walk(strides=20)), 70, sensors, seed=1)

    assert (np.diff(made.t_s) > 0).all()
    assert np.diff(made.t_s).std() > 0
    assert made.left.force_n[: rate_hz // 4].mean() == pytest.approx(20, abs=3)
    assert (made.left.force_n == again.left.force_n).all()
    assert len(made.left.force_n) == len(made.right.angle_rad) == len(made.t_s)
