"""Pairs of bytes and rows: what a sensor sends, and what is read of it."""

from pathlib import Path

import pytest

from rehab.sources.intake.sensor_frames import SensorFrameReader, compute_checksum
from tests.sources.labs import frame

NAMES = b"$H,left_force_n,left_angle_rad*4D\n"
SKETCH = Path(__file__).parents[2] / "docs" / "garry_sensor" / "garry_sensor.ino"


@pytest.mark.parametrize(
    ("data", "rows"),
    [
        (
            b"$D,1500000,412.5,0.12*6D\n",
            [{"time_s": 1.5, "left_force_n": 412.5, "left_angle_rad": 0.12}],
        ),
        (b"$D,2000000,,0.5*71\r\n", [{"time_s": 2.0, "left_force_n": None, "left_angle_rad": 0.5}]),
    ],
)
def test_golden_frames(data, rows):
    assert SensorFrameReader().read(NAMES + data) == rows


def test_frames_of_any_cut_are_the_same():
    data = NAMES + b"".join(frame("D", n * 10_000, n, n / 10) for n in range(50))
    whole = SensorFrameReader().read(data)
    assert len(whole) == 50
    for size in (1, 7, 64):
        reader = SensorFrameReader()
        parts = [data[at : at + size] for at in range(0, len(data), size)]
        assert [row for part in parts for row in reader.read(part)] == whole


@pytest.mark.parametrize("place", range(24))
def test_a_damaged_byte_costs_one_frame_and_no_value_is_wrong(place):
    good = b"$D,1500000,412.5,0.12*6D\n"
    bad = good[:place] + bytes([good[place] ^ 0x04]) + good[place + 1 :]
    reader = SensorFrameReader()
    rows = reader.read(NAMES + bad + good)

    assert rows[-1] == {"time_s": 1.5, "left_force_n": 412.5, "left_angle_rad": 0.12}
    assert len(rows) + reader.damaged == 2


def test_microseconds_go_on_where_they_wrap_around():
    reader = SensorFrameReader()
    rows = reader.read(NAMES + frame("D", 2**32 - 10_000, 1, 1) + frame("D", 0, 1, 1))

    first, second = (float(row["time_s"]) for row in rows)
    assert second - first == pytest.approx(0.01)


def test_endless_noise_takes_no_memory():
    reader = SensorFrameReader()
    for _ in range(1000):
        assert reader.read(b"\xff" * 1000) == []
    assert len(reader._partial) <= 1024
    assert reader.read(b"\n" + NAMES + frame("D", 0, 1, 1))[0]["left_force_n"] == 1


def test_the_sketch_sends_what_is_documented():
    text = SKETCH.read_text("utf-8")
    assert "921600" in text
    for word in ("$", "*%02X", "micros()", "left_force_n"):
        assert word in text
    assert compute_checksum(b"H,left_force_n,left_angle_rad") == 0x4D
