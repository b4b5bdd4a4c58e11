"""Worn sensors as a lab sends them: whatever units, stalls, losses and cuts."""

from argparse import ArgumentParser

import numpy as np
import pytest

from rehab.gait.wearables import VERSION
from rehab.sources.intake.settings import IntakeSettings, add_signal_arguments
from rehab.sources.reporting import SourceError
from rehab.training.measures import MEASURES, WORN_CHANNELS
from rehab.training.steps import Side, select_value
from tests.sources.intake_harness import IntakeHarness
from tests.support.simulated_leg import STRIDE_S, random_mounting, walk_foot

LEFT = "left.foot=lax,lay,laz,lgx*0.017453,lgy*0.017453,lgz*0.017453"
RIGHT = "right.foot=rax,ray,raz,rgx*0.017453,rgy*0.017453,rgz*0.017453"
AXES = ("ax", "ay", "az", "gx", "gy", "gz")


def settings_of(*wearables):
    parser = ArgumentParser()
    add_signal_arguments(parser)
    parser.set_defaults(side=None)
    return IntakeSettings.read(parser.parse_args(["--wearable", *wearables]))


def walk(seconds=40.0, stamps=None, late_s=0.5 * STRIDE_S, **more):
    """Return rows of two feet, the right one later than the left, both mounted in some way."""
    t_s, rate, acceleration = walk_foot(seconds + 2)
    count = int(seconds * 100)
    shift = round(late_s * 100)
    table = {"time_s": t_s[:count] if stamps is None else stamps}
    for letter, first, seed in (("l", shift, 1), ("r", 0, 2)):
        part, matrix = slice(first, first + count), random_mounting(seed)
        signals = np.hstack((acceleration[part] @ matrix.T, np.degrees(rate[part]) @ matrix.T))
        table |= {f"{letter}{axis}": signals[:, n] for n, axis in enumerate(AXES)}
    table |= more
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]


def measure(rows, chunk=20, wearables=(LEFT, RIGHT), **more):
    settings = settings_of(*wearables)
    harness = IntakeHarness(wearables=settings.wearables, mass_kg=None, **more)
    harness.send(rows, chunk)
    harness.intake.finish()
    return harness.strides(), harness.said


@pytest.mark.parametrize("chunk", [pytest.param(1, marks=pytest.mark.wide), 20, 5000])
def test_strides_of_both_feet_have_figures_of_their_own_and_no_a2(chunk):
    found, said = measure(walk(), chunk)
    assert sum("to the left" in text for text in said) == 2
    assert [stride.number for stride in found] == list(range(1, len(found) + 1))
    for side in Side:
        own = [stride for stride in found if stride.side is side]
        assert len(own) >= 30
        for stride in own:
            assert stride.value is None
            assert stride.reasons == ()
            assert stride.extra["wearable_foot"] == VERSION
            assert stride.extra["stride_s"] == pytest.approx(STRIDE_S, abs=0.02)
            assert stride.extra["cadence_min"] == pytest.approx(100, abs=2)
            assert stride.extra["foot_stance_percent"] == pytest.approx(65, abs=1)
            assert stride.extra["foot_strike_deg"] == pytest.approx(18, abs=1)
            assert stride.extra["sensor_rate_hz"] == pytest.approx(100, abs=1)
    unequal = [one.extra.get("step_asymmetry_percent") for one in found]
    # All but those whose other leg was not known yet.
    assert sum(one is not None for one in unequal) >= len(found) - 6
    assert max(one for one in unequal if one is not None) < 1
    chosen = select_value(found[9], MEASURES["foot_strike"])
    assert chosen.value == found[9].extra["foot_strike_deg"]
    assert {name for one in found for name in one.extra} & WORN_CHANNELS >= {
        "push_off_deg_s", "foot_swing_percent", "cadence_min",
    }  # fmt: skip


def test_unequal_steps_are_measured():
    found, _ = measure(walk(late_s=0.4 * STRIDE_S))
    unequal = [one.extra.get("step_asymmetry_percent") for one in found]
    assert np.median([one for one in unequal if one is not None]) == pytest.approx(20, abs=1)


def test_late_samples_are_put_back():
    rows = walk()
    stamps = np.array([row["time_s"] for row in rows])
    for at in range(1000, 3600, 130):
        stamps[at : at + 7] = stamps[at] + 0.06 + np.arange(7) * 0.0005
    (late, _), (clean, _) = measure(walk(stamps=stamps)), measure(rows)
    assert len(late) == len(clean)
    for stride, other in zip(late, clean, strict=True):
        assert stride.extra["stride_s"] == pytest.approx(other.extra["stride_s"], abs=0.004)


def test_the_devices_own_count_says_where_samples_were_lost():
    """Stamps of arrival close the gaps; the packet counter shows them."""
    rows = walk(frame=np.arange(4000.0))
    kept = [row for place, row in enumerate(rows) if place % 50 >= 5]
    arrival = [row | {"time_s": place * 0.01} for place, row in enumerate(kept)]
    for row in kept:
        row["time_s"] = row["frame"] * 0.01
    counted, _ = measure(kept)
    times = np.array([one.extra["stride_s"] for one in counted])
    assert len(times) >= 60
    assert np.abs(times - STRIDE_S).max() < 0.05
    blind, _ = measure([{k: v for k, v in row.items() if k != "frame"} for row in arrival])
    assert np.abs(np.array([one.extra["stride_s"] for one in blind]) - STRIDE_S).max() > 0.05


@pytest.mark.parametrize(
    ("factors", "cure"),
    [({"a": 1 / 9.81, "g": 1.0}, "acc_x\\*9.81"), ({"a": 1.0, "g": 57.3}, "gyr_x\\*0.01745")],
)
def test_units_that_cannot_be_are_refused_with_the_cure(factors, cure):
    rows = [
        {name: value * (1 if name == "time_s" else factors[name[1]]) for name, value in row.items()}
        for row in walk(5)
    ]
    found, said = measure(rows, wearables=[LEFT])
    assert found == []
    assert any(np.char.count(text, cure.replace("\\", "")) for text in said)


def test_a_sensor_that_is_too_slow_is_refused():
    found, said = measure([row for place, row in enumerate(walk(10)) if place % 3 == 0])
    assert found == []
    assert any("33" in text and "50 to 5000" in text for text in said)


@pytest.mark.parametrize(
    "text", ["gyro_z", "left.hand=x", "up.foot=x", "left.foot=", "left.foot=x,y"]
)
def test_what_maps_no_sensor_is_refused_with_the_cure(text):
    with pytest.raises(SourceError, match="Write SIDE.PLACE=COLUMNS"):
        settings_of(text)
