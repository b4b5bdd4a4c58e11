"""A treadmill that speaks: FTMS frames, rows of a lab, the simulated one."""

from __future__ import annotations

import pytest

from rehab.sources.intake.rows import BadRow
from rehab.sources.intake.treadmill_and_heart_rate import (
    decode_treadmill,
    encode_treadmill,
    read_devices,
)
from rehab.sources.synthetic.source import find_heart_rate, find_speed
from tests.sources.intake_harness import IntakeHarness, rows_of

# Frames by the tables of FTMS 1.0, section 4.9.1: flags, then the fields in their order.
FRAMES = {
    "speed alone": ("0000 2001", {"belt_speed_m_s": 0.8}),  # 2.88 km/h
    "still": ("0000 0000", {"belt_speed_m_s": 0.0}),
    "more data follows": ("0100", {}),  # bit 0: no speed in this one
    "average, distance, incline": (
        "0E00 6801 5E01 400100 0F00 0000",
        {"belt_speed_m_s": 1.0, "incline_percent": 1.5},
    ),
    "downhill": ("0800 6801 F6FF 0000", {"belt_speed_m_s": 1.0, "incline_percent": -1.0}),
    "incline not available": ("0800 6801 FF7F FF7F", {"belt_speed_m_s": 1.0}),
    # Flags 0x2484 with distance, energy, elapsed time, as a walking pad sends them.
    "as from a walking pad": (
        "8424 2C01 0A0000 0100 FFFF FF 1E00 28 00",
        {"belt_speed_m_s": 0.8333},
    ),
}


@pytest.mark.parametrize(("frame", "said"), FRAMES.values(), ids=FRAMES)
def test_a_frame_says_speed_and_incline(frame, said):
    assert decode_treadmill(bytes.fromhex(frame)) == pytest.approx(said)


@pytest.mark.parametrize("frame", ["", "00", "0000", "000020", "08002001", "0C002001000000"])
def test_a_frame_that_is_cut_off_is_refused(frame):
    with pytest.raises(BadRow, match="whole"):
        decode_treadmill(bytes.fromhex(frame))


def test_what_is_encoded_is_decoded():
    for speed in (0.0, 0.5, 0.83, 2.0):
        said = decode_treadmill(encode_treadmill(speed))
        assert said["belt_speed_m_s"] == pytest.approx(speed, abs=0.002)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"belt_speed_m_s": 0.8, "value": 3.9}, {"belt_speed_m_s": 0.8}),
        ({"LeftBelt.Speed": 0.8, "RightBelt.Speed": 0.6}, {"belt_speed_m_s": 0.7}),
        ({"LeftBelt.Speed": 0.8, "RightBelt.Speed": None}, {"belt_speed_m_s": 0.8}),
        ({"weight_support_percent": 20.0}, {"weight_support_percent": 20.0}),
        ({"belt_speed_m_s": "fast"}, {}),
        ({"belt_speed_m_s": float("nan")}, {}),
        ({"heart_rate": 91.0}, {"heart_rate": 91.0}),
        ({"value": 3.9}, {}),
    ],
)
def test_a_row_says_it_in_cells(row, said):
    assert read_devices(row) == pytest.approx(said)


def test_the_simulated_one_grows_faster_up_to_an_end():
    speeds = [find_speed(time_s) for time_s in (-1, 0, 59, 60, 240, 9_999)]
    assert speeds == pytest.approx([0.5, 0.5, 0.5, 0.6, 0.9, 0.9])


def test_the_simulated_heart_rises_and_settles():
    rates = [find_heart_rate(time_s) for time_s in (-1, 0, 90, 9_999)]
    assert rates == [72, 72, 101, 118]


def test_strides_carry_what_was_last_said():
    harness = IntakeHarness()
    harness.send(
        [
            {"value": 3.9},
            {"LeftBelt.Speed": 0.5, "RightBelt.Speed": 0.7},  # a row of its own
            {"value": 3.8, "stance_s": 0.7},
            {"value": 3.7, "belt_speed_m_s": 0.9},
            {"value": 3.6},
            {"joy": 1.0},
        ]
    )
    assert [stride.extra.get("belt_speed_m_s") for stride in harness.strides()] == [
        None,
        pytest.approx(0.6),
        0.9,
        0.9,
    ]
    assert harness.intake.quality.bad_rows == 1  # joy


def test_samples_of_raw_signals_say_it_too(table):
    harness = IntakeHarness()
    harness.send([row | {"belt_speed_m_s": 0.8} for row in rows_of(table)])
    harness.intake.finish()
    assert {stride.extra["belt_speed_m_s"] for stride in harness.strides()} == {0.8}
