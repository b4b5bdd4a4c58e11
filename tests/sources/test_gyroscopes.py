"""Gyroscopes on feet, as a lab sends them: strides with times, whatever sign, stall or cut."""

from argparse import ArgumentParser

import numpy as np
import pytest

from rehab.gait import GyroscopeStrideDetector
from rehab.sources.intake.settings import IntakeSettings, add_signal_arguments
from rehab.sources.reporting import SourceError
from rehab.training.measures import Measure
from rehab.training.steps import Side, select_value
from tests.sources.intake_harness import IntakeHarness

STRIDE_S = 1.2
COLUMNS = ["left.foot=gyro_l*-0.017453", "right.foot=gyro_r*0.017453"]
CADENCE = Measure("cadence", "cadence", "1/min", 0, 300, 0, 200, channel="cadence_min")


def turn(t_s, ahead_s=0.0):
    """Return the rate of a foot [rad/s] that swings for 0.4 s of each stride."""
    phase = (t_s + ahead_s) % STRIDE_S
    rate = np.where(phase < 0.4, -5.0 * np.sin(np.pi * phase / 0.4), 0.0)
    rate += np.where((phase >= 0.4) & (phase < 0.5), 2 * np.sin(np.pi * (phase - 0.4) / 0.1), 0.0)
    return rate + np.where(phase > 1.0, 2 * np.sin(np.pi * (phase - 1.0) / 0.2), 0.0)


def settings_of(*gyroscopes):
    parser = ArgumentParser()
    add_signal_arguments(parser)
    parser.set_defaults(side=None)
    return IntakeSettings.read(parser.parse_args(["--gyroscope", *gyroscopes]))


def walk(rate_hz=100, seconds=40, stamps=None):
    taken_s = np.arange(seconds * rate_hz) / rate_hz
    left, right = np.degrees(turn(taken_s)), np.degrees(turn(taken_s, STRIDE_S / 2))
    table = zip(taken_s if stamps is None else stamps, left, right, strict=True)
    return [{"time_s": t, "gyro_l": a, "gyro_r": b, "left_force_n": 700.0} for t, a, b in table]


def measure(rows, chunk=20, **more):
    harness = IntakeHarness(gyroscopes=settings_of(*COLUMNS).gyroscopes, mass_kg=None, **more)
    harness.send(rows, chunk)
    harness.intake.finish()
    return harness.strides(), harness.said


@pytest.mark.parametrize("chunk", [pytest.param(1, marks=pytest.mark.wide), 20, 5000])
def test_strides_of_both_feet_have_times_and_no_a2(chunk):
    found, said = measure(walk(), chunk)
    # The left one is mapped with the wrong sign, which is found.
    assert any("gyro_l" in text and "turned" in text for text in said)
    assert any("gyro_r" in text and "as it comes" in text for text in said)
    assert [stride.number for stride in found] == list(range(1, len(found) + 1))
    for side, begin_s in ((Side.LEFT, 0.4), (Side.RIGHT, 1.0)):
        own = [stride for stride in found if stride.side is side]
        assert len(own) >= 30
        for stride in own:
            assert stride.value is None
            assert stride.extra["stride_s"] == pytest.approx(STRIDE_S, abs=0.02)
            assert stride.extra["cadence_min"] == pytest.approx(100, abs=2)
            assert stride.extra["initial_contact_s"] % STRIDE_S == pytest.approx(begin_s, abs=0.03)
            assert stride.time_s == pytest.approx(
                stride.extra["initial_contact_s"] + stride.extra["stride_s"]
            )
    chosen = select_value(found[0], CADENCE)
    assert chosen.value == found[0].extra["cadence_min"]


def test_late_samples_are_put_back():
    rows = walk()
    stamps = np.array([row["time_s"] for row in rows])
    for at in range(1000, 3600, 130):
        stamps[at : at + 7] = stamps[at] + 0.06 + np.arange(7) * 0.0005
    (late, _), (clean, _) = measure(walk(stamps=stamps)), measure(rows)
    assert len(late) == len(clean)
    for stride, other in zip(late, clean, strict=True):
        assert stride.extra["stride_s"] == pytest.approx(other.extra["stride_s"], abs=0.004)


def test_the_sign_is_that_of_what_is_walked():
    taken_s = np.arange(0, 30, 0.01)
    for sign in (1.0, -1.0):
        detector, count = GyroscopeStrideDetector(100), 0
        for first in range(0, len(taken_s), 50):
            part = taken_s[first : first + 50]
            count += len(detector.feed(part, sign * turn(part)))
        assert (detector.sign, count >= 22) == (sign, True)


def test_standing_has_no_strides_and_no_sign():
    detector = GyroscopeStrideDetector(100)
    taken_s = np.arange(0, 30, 0.01)
    assert detector.feed(taken_s, 0.3 * np.sin(5 * taken_s)) == []
    assert detector.sign is None


@pytest.mark.parametrize("text", ["gyro_z", "left.hand=x", "up.foot=x", "left.foot="])
def test_what_maps_no_gyroscope_is_refused_with_the_cure(text):
    with pytest.raises(SourceError, match="Write SIDE.SEGMENT=COLUMN"):
        settings_of(text)
