"""Contacts from gyroscopes, against the events of data/raw/gaitmap_imu."""

import csv

import numpy as np
import pytest

from rehab.gait import ContactKind, GaitInputError, GyroscopeDetector
from rehab.gait.__main__ import main
from rehab.gait.contacts.gyroscope_strides import measure_gyroscope
from tests.support.data import signals

RATE_HZ = 204.8


def read_feet():
    """Return for each foot its times, sagittal rate [rad/s] and events [s]."""
    folder = signals("gaitmap_imu")
    with (folder / "imu_sample.csv").open() as file:
        sensors, axes = next(csv.reader(file)), next(csv.reader(file))
        table = np.loadtxt(file, delimiter=",", unpack=True)
    with (folder / "stride_events_sample.csv").open() as file:
        events = list(csv.DictReader(file))
    feet = {}
    for foot in ("left", "right"):
        column = list(zip(sensors, axes, strict=True)).index((f"{foot}_sensor", "gyr_y"))
        own = [event for event in events if event["foot"] == foot]
        feet[foot] = (
            np.arange(table.shape[1]) / RATE_HZ,
            np.radians(table[column]),
            {kind: np.array([float(e[kind]) for e in own]) / RATE_HZ for kind in ("ic", "tc")},
        )
    return feet


@pytest.fixture(scope="module")
def feet():
    return read_feet()


def times_of(found, kind):
    return np.array([contact.time_s for contact in found if contact.kind is kind])


@pytest.mark.parametrize(
    ("kind", "column", "median_s", "p95_s"),
    [(ContactKind.INITIAL, "ic", 0.010, 0.020), (ContactKind.TERMINAL, "tc", 0.025, 0.035)],
)
def test_real_feet(feet, kind, column, median_s, p95_s):
    errors, missed, false = [], 0, 0
    for time, rate, events in feet.values():
        found = times_of(GyroscopeDetector(RATE_HZ).feed(time, rate), kind)
        true = events[column]
        apart = np.abs(found[:, np.newaxis] - true)
        missed += int((apart.min(axis=0) > 0.15).sum())
        inside = (found > true[0] - 0.15) & (found < true[-1] + 0.15)
        alone = (apart.min(axis=1) > 0.15) & inside
        # A contact counts as false where no stride of the reference is under way.
        false += int(alone.sum())
        errors += [error for error in apart.min(axis=0) if error <= 0.15]

    assert missed <= 1
    assert false == 0
    assert np.median(errors) <= median_s
    assert np.percentile(errors, 95) <= p95_s


@pytest.mark.parametrize("size", [1, 3, 7, 50, 1000])
def test_the_same_in_any_chunks(feet, size):
    time, rate, _ = feet["left"]
    detector = GyroscopeDetector(RATE_HZ)
    found = []
    for first in range(0, len(time), size):
        found += detector.feed(time[first : first + size], rate[first : first + size])

    assert found == GyroscopeDetector(RATE_HZ).feed(time, rate)


def swing(rate_hz=100, strides=20, stride_s=1.2, strength=5.0):
    """Return a leg that turns back, swings for 0.4 s and turns back again."""
    time = np.arange(int(strides * stride_s * rate_hz)) / rate_hz
    phase = time % stride_s
    rate = np.where(phase < 0.4, -strength * np.sin(np.pi * phase / 0.4), 0.0)
    rate += np.where((phase >= 0.4) & (phase < 0.6), 2 * np.sin(np.pi * (phase - 0.4) / 0.2), 0.0)
    return time, rate + np.where(phase > 1.0, 2 * np.sin(np.pi * (phase - 1.0) / 0.2), 0.0)


@pytest.mark.parametrize("rate_hz", [50, 100, 500])
@pytest.mark.parametrize("strength", [2.5, 6.0])
def test_foot_and_shank(rate_hz, strength):
    time, rate = swing(rate_hz, strength=strength)
    foot = GyroscopeDetector(rate_hz).feed(time, rate)
    shank = GyroscopeDetector(rate_hz, segment="shank").feed(time, rate)

    assert times_of(foot, ContactKind.INITIAL) % 1.2 == pytest.approx(0.4, abs=0.02)
    assert times_of(shank, ContactKind.INITIAL) % 1.2 == pytest.approx(0.5, abs=0.03)
    assert times_of(shank, ContactKind.TERMINAL)[1:] % 1.2 == pytest.approx(1.1, abs=0.03)
    assert len(times_of(foot, ContactKind.INITIAL)) >= 19


def test_standing_and_rubbish_are_no_steps():
    time = np.arange(3000) / 100
    sway = 0.6 * np.sin(time * 5)
    assert GyroscopeDetector(100).feed(time, sway) == []
    assert GyroscopeDetector(100).feed(time, np.full(3000, np.nan)) == []


def test_gaps_and_clock_jumps_cost_one_swing():
    time, rate = swing()
    time[1000:] -= 5.0
    rate[500:505] = np.nan
    found = GyroscopeDetector(100).feed(time, rate)
    assert len(times_of(found, ContactKind.INITIAL)) >= 17


def test_settings_that_cannot_be():
    with pytest.raises(GaitInputError, match="Use foot or shank"):
        GyroscopeDetector(100, segment="thigh")
    with pytest.raises(GaitInputError, match="Give the samples' rate"):
        GyroscopeDetector(5)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_sign_is_found(feet, sign):
    for time, rate, _ in feet.values():
        strides, found = measure_gyroscope(time, sign * rate)
        assert found == sign
        assert len(strides) >= 20
        assert 80 < np.median([stride.cadence_min for stride in strides]) < 130


def test_the_command_measures_a_gyroscope(feet, tmp_path, capsys):
    time, rate, _ = feet["left"]
    path = tmp_path / "foot.csv"
    np.savetxt(path, np.column_stack([time, -np.degrees(rate)]), "%.9g", ",", header="time,gyr_y",
               comments="")  # fmt: skip
    assert main(["gyroscope", str(path), "--rate-column", "gyr_y*0.0174533"]) == 0
    assert "its sign is turned" in capsys.readouterr().out
    assert main(["gyroscope", str(path), "--rate-column", "gyr_z"]) == 2
    assert "has no column gyr_z. It has: time, gyr_y" in capsys.readouterr().err


def test_nobody_walks():
    time = np.arange(3000) / 100
    with pytest.raises(GaitInputError, match="No strides are found with either sign"):
        measure_gyroscope(time, 0.1 * np.sin(time))
