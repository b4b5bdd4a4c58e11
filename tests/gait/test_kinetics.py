"""The parts that A2 is made of, each against something that is known."""

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, compute_ankle_moment, measure_strides
from rehab.gait.signals.filters import (
    ZeroPhaseFilter,
    differentiate,
    find_last,
    interpolate_peak,
)
from tests.gait.walks import read_moore_columns


@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_the_filter_is_scipys(rate_hz):
    rng = np.random.default_rng(0)
    rows = np.cumsum(rng.normal(size=(2, 3 * rate_hz)), axis=1)
    expected = filtfilt(*butter(2, 6 / (rate_hz / 2)), rows, padlen=rate_hz)
    smooth = ZeroPhaseFilter(6, rate_hz).smooth(rows)

    inner = slice(rate_hz // 2, -rate_hz // 2)
    assert smooth[:, inner] == pytest.approx(expected[:, inner], abs=0.02)


@pytest.mark.parametrize(("rate_hz", "error"), [(50, 0.005), (100, 0.0005), (1000, 1e-6)])
def test_slope(rate_hz, error):
    time = np.arange(rate_hz) / rate_hz
    slope = differentiate(np.sin(2 * np.pi * 5 * time), rate_hz)

    expected = 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * time)
    assert np.abs(slope - expected)[2:-2].max() / (2 * np.pi * 5) < error


def test_the_slope_of_a_line_is_the_same_up_to_both_ends():
    assert differentiate(np.arange(9.0), 250) == pytest.approx(np.full(9, 250.0))


def test_peak():
    place, height = interpolate_peak(np.array([0.0, 3.0, 4.0, 3.0]), 2)
    assert (place, height) == (2.0, 4.0)
    values = 4 - (np.arange(5.0) - 2.3) ** 2
    assert interpolate_peak(values, 2) == pytest.approx((2.3, 4.0))
    assert interpolate_peak(np.ones(3), 1) == (1.0, 1.0)


def test_last():
    assert [find_last(np.array(found, dtype=bool)) for found in ([], [0], [1, 0, 1, 0], [1])] == [
        -1,
        -1,
        2,
        0,
    ]


def test_moment_of_a_force():
    moment = compute_ankle_moment(
        [0.0, 100.0, 0.0, 0.0, np.nan],
        [700.0, 700.0, 30.0, 700.0, 700.0],
        [0.15, 0.15, 4000.0, 4000.0, 0.15],
        [0.0] * 5,
        [0.1] * 5,
    )
    assert moment.tolist()[:3] == pytest.approx([105.0, 115.0, 0.0])
    assert np.isnan(moment[3:]).all()


def test_a2_from_force_and_center_of_pressure():
    """A lab without inverse dynamics: the left leg of moore2013, whose plate tells where it bears.

    The foot's own weight and inertia, left out, make some percent.
    """
    column = read_moore_columns()
    moment = compute_ankle_moment(
        column["LeftGRF_x"],
        column["LeftGRF_y"],
        column["LeftCOP_x"],
        column["LeftFoot_x"],
        column["LeftFoot_y"],
    )
    leg = ("LeftGRF_y", "LeftAnklePlantarFlexionMoment", "LeftAnklePlantarFlexionAngle")
    force, lab_moment, angle = (column[name] for name in leg)
    ours, labs = (
        measure_strides(
            column["time"],
            {"left": LegSamples(force, moment, angle)},
            rate_hz=100,
            mass_kg=79.4,
        )
        for moment in (moment, lab_moment)
    )

    ratios = [a.a2_w_kg / b.a2_w_kg for a, b in zip(ours, labs, strict=True) if a.valid and b.valid]
    assert len(ratios) >= 34
    assert np.mean(ratios) == pytest.approx(1, abs=0.1)
    assert np.std(ratios) < 0.06
