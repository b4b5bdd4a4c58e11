"""Sensors by Bluetooth: what each kind's bytes mean, and what happens when the radio fails."""

from __future__ import annotations

import asyncio
import math
import struct
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from rehab.sources.arguments import make_parser
from rehab.sources.ble import source as ble
from rehab.sources.ble.heart_rate import HeartRate
from rehab.sources.ble.host_clock import DRIFT, HostClock
from rehab.sources.ble.movella_dot import MovellaDot
from rehab.sources.ble.nordic_uart import NordicUart
from rehab.sources.ble.source import BleSource
from rehab.sources.ble.witmotion import WitMotion
from rehab.sources.reporting import SourceError
from tests.sources.fake_bleak import FakeBleak, FakeSensor
from tests.sources.intake_harness import IntakeHarness
from tests.sources.labs import frame
from tests.support.simulated_leg import STRIDE_S, random_mounting, walk_foot

SKETCH = Path(__file__).parents[2] / "docs/garry_sensor/garry_sensor_ble/garry_sensor_ble.ino"
WRITES = NordicUart._writes
# Movella DOT, mode 21: 1 s; 0, 0, 9.8125 m/s²; 90, −45, 0 °/s, as IEEE 754 in little-endian.
DOT = bytes.fromhex("40420f00 00000000 00000000 00001d41 0000b442 000034c2 00000000")
# WitMotion 0x61: 1 g along z (2048 = 0x0800), 1000 °/s about x (16384 = 0x4000), yaw 90°.
WIT = bytes.fromhex("5561 0000 0000 0008 0040 0000 0000 0000 0000 0040")


def test_a_movella_dot():
    (row,) = MovellaDot().read(DOT, 5.0)
    assert row["time_s"] == 1.0
    assert [row[axis] for axis in ("ax", "ay", "az")] == [0, 0, 9.8125]
    assert [row[axis] for axis in ("gx", "gy", "gz")] == [math.pi / 2, -math.pi / 4, 0]


def test_a_dots_clock_wraps_around_after_71_minutes_and_doubles_are_left_out():
    dot = MovellaDot()
    stamps = [(2**32 - 20_000 + 16_667 * n) % 2**32 for n in (0, 1, 1, 2, 4)]
    rows = [row for stamp in stamps for row in dot.read(struct.pack("<I", stamp) + DOT[4:], 0)]
    steps = np.diff([row["time_s"] for row in rows])
    assert steps == pytest.approx([0.016667, 0.016667, 0.033334])
    assert dot.read(DOT[:20], 0) == []
    assert dot.damaged == 1


# Heart Rate Measurement: flags, then the rate in one byte or two, then energy and beats apart.
@pytest.mark.parametrize(
    ("data", "rate"),
    [
        ("00 48", 72),
        ("01 2C01", 300),
        ("16 48 E803 F003", 72),  # touches the skin, with beats apart
        ("1E 48 0A00 E803", 72),
        ("04 48", None),  # does not touch the skin
        ("02 48", 72),  # says nothing of the skin
        ("00 00", None),
    ],
)
def test_a_heart_rate_sensor(data, rate):
    rows = HeartRate().read(bytes.fromhex(data), 7.0)
    assert rows == ([] if rate is None else [{"heart_rate": rate}])


@pytest.mark.parametrize("data", ["", "00", "01 48"])
def test_a_heart_rate_that_is_cut_off_is_damaged(data):
    sensor = HeartRate()
    assert sensor.read(bytes.fromhex(data), 7.0) == []
    assert sensor.damaged == 1


async def test_strides_carry_the_heart_rate_for_ten_seconds(quick):
    belt = FakeSensor("Belt", HeartRate.notifies)
    foot = FakeSensor("GARRY-1", NordicUart.notifies, WRITES)
    source, said = make(["left.foot=GARRY-1", "--heart-rate", "Belt"], FakeBleak(belt, foot))
    async with reading(source) as harness:
        await until(lambda: belt.is_read)
        for data, wait_s in (("00 48", 0), ("00 5A", 9.9), ("04 FF", 0.2)):
            belt.send(bytes.fromhex(data))
            harness.intake.add_rows([{"value": 3.9}])
            harness.time.now_s += wait_s
        harness.intake.add_rows([{"value": 3.9}])
        rates = [stride.extra.get("heart_rate") for stride in harness.strides()]
    assert rates == [72, 90, 90, None]
    assert any("Reading Belt (heart rate)" in text for text in said)


@pytest.mark.parametrize("part", [1, 7, 20, 40])
def test_a_witmotion_in_parts(part):
    wit, data = WitMotion(), b"\x00\x55" + 3 * WIT
    rows = [row for at in range(0, len(data), part) for row in wit.read(data[at : at + part], 7.0)]
    assert len(rows) == 3
    assert rows[2]["az"] == pytest.approx(9.80665)
    assert rows[2]["gx"] == pytest.approx(math.radians(1000))
    assert rows[2]["time_s"] == 7.0  # it has no clock
    assert "cannot be noticed" in WitMotion.warning


def test_own_lines_and_the_time_that_was_asked_for():
    uart = NordicUart()
    data = frame("H", "frame", "ax") + frame("D", 2**32 - 1000, 7, 9.81) + frame("T", 3, 500)
    rows = [row for at in range(0, len(data), 20) for row in uart.read(data[at : at + 20], 0)]
    assert rows == [{"time_s": (2**32 - 1000) / 1e6, "frame": 7.0, "ax": 9.81}]
    assert uart.read_times() == [(3, (2**32 + 500) / 1e6)]
    assert uart.read_times() == []
    assert uart.ask_time(4) == (WRITES, b"T,4\n")


def test_the_sketch_sends_these_lines():
    text = SKETCH.read_text("utf-8")
    assert '"H,frame,ax,ay,az,gx,gy,gz"' in text
    assert '"T,%d,%lu"' in text
    assert all(one.upper() in text for one in (NordicUart.notifies, WRITES))


def test_a_sensors_clock_on_ours():
    clock = HostClock()
    assert clock.error_s(0) == math.inf
    clock.exchange(100.0, 5.006, 100.02)  # asked at 100, it read 5.006, heard at 100.02
    assert clock.error_s(100.02) == pytest.approx(0.010)
    assert clock.place(6.0, 101.0) == pytest.approx(6.0 + 95.004)
    clock.exchange(102.0, 7.0, 102.2)  # a slow exchange is worse than one some seconds old
    assert clock.error_s(102.2) == pytest.approx(0.010 + DRIFT * 2.18)
    clock.exchange(103.0, 8.001, 103.004)
    times = [clock.place(8 + n / 100, 103.005 + n / 100) for n in range(6000)]
    assert np.diff(times) == pytest.approx(0.01, abs=2e-5)  # no stride is longer or shorter
    assert times[-1] == pytest.approx(8 + 59.99 + 95.001, abs=1e-6)


def test_without_exchanges_the_soonest_samples_say_the_time():
    clock, noise = HostClock(), np.random.default_rng(1)
    late = [
        clock.place(n / 60, 50 + n / 60 + 0.02 + noise.exponential(0.02)) - (50 + n / 60)
        for n in range(3600)
    ]
    assert late[-1] == pytest.approx(0.02, abs=0.002)
    assert clock.error_s(110.0) == math.inf  # by how much is not known


@pytest.mark.parametrize(
    "wrong",
    [["left=x"], ["left.foot="], ["left.foot=a", "left.foot=b"], ["left.foot=a", "right.foot=a"]],
)
def test_what_names_no_sensors_is_refused(wrong):
    with pytest.raises(SourceError, match="SIDE|place"):
        make(wrong, FakeBleak())


def make(sensors, radio):
    options = make_parser("ble", BleSource).parse_args(["--sensor", *sensors, "--token", "t"])
    said: list[str] = []
    return BleSource(options, said.append, radio), said


@asynccontextmanager
async def reading(source):
    harness = IntakeHarness(wearables=source.settings.wearables, mass_kg=None)
    task = asyncio.create_task(source.read(harness.intake))
    try:
        yield harness
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def until(condition):
    async with asyncio.timeout(5):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.001)


def lines(seed, shift_s=0.0, seconds=40.0, begin_us=2**32 - 15_000_000):
    """Return a walk's lines: its names, then a sample each."""
    _, rate, acceleration = walk_foot(seconds + 2)
    first, count = round(shift_s * 100), round(seconds * 100)
    matrix = random_mounting(seed)
    table = np.hstack((acceleration @ matrix.T, rate @ matrix.T))[first : first + count]
    yield frame("H", "frame", "ax", "ay", "az", "gx", "gy", "gz")
    for n, row in enumerate(table):
        cells = [f"{cell:.4f}" for cell in row]
        yield frame("D", (begin_us + 10_000 * n) % 2**32, n, *cells)


@pytest.fixture
def quick(monkeypatch):
    for name, seconds in (("RETRY_S", 0.002), ("SILENT_S", 0.2), ("ASK_FIRST_S", 0.001)):
        monkeypatch.setattr(ble, name, seconds)


class OwnClock:
    """Our clock, as fast as a test wants."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize(("round_trip_s", "agrees"), [(0.006, True), (0.03, False)])
async def test_two_own_sensors_and_their_clocks(quick, round_trip_s, agrees):
    """Steps are compared only where both clocks are known well enough."""
    own = OwnClock()
    sensors = [FakeSensor(f"GARRY-{n}", NordicUart.notifies, WRITES) for n in (1, 2)]
    source, said = make(["left.foot=GARRY-1", "right.foot=garry-2"], FakeBleak(*sensors))
    source._monotonic = own
    starts = [2**32 - 15_000_000, 77_000_000]
    for sensor, start_us in zip(sensors, starts, strict=True):

        def answer(question, sensor=sensor, start_us=start_us):
            own.now_s += round_trip_s / 2
            now_us = round(start_us + (own.now_s - 1000.0) * 1e6) % 2**32
            own.now_s += round_trip_s / 2
            sensor.send(frame("T", int(question[2:]), now_us))

        sensor.answer = answer
    async with reading(source) as harness:
        await until(lambda: all(len(one.written) == 8 for one in sensors))
        begin_s = own.now_s
        since_us = round((begin_s - 1000) * 1e6)
        walks = [lines(n, n * STRIDE_S / 2, begin_us=starts[n] + since_us) for n in (0, 1)]
        for both in zip(*walks, strict=True):
            for sensor, line in zip(sensors, both, strict=True):
                sensor.send(line)
            own.now_s += 0.01
        strides = harness.strides()
    assert sum("Reading" in text for text in said) == 2
    compared = [one.extra.get("step_asymmetry_percent") for one in strides]
    assert len(strides) >= 60
    if agrees:
        known = [one for one in compared if one is not None]
        assert len(known) >= len(strides) - 6  # those before the sign was known are not compared
        assert max(known) < 2 * round_trip_s / STRIDE_S * 100
    else:
        assert set(compared) == {None}


async def test_lost_and_doubled_packets_and_a_sensor_that_comes_back(quick):
    own = OwnClock()
    sensor = FakeSensor("GARRY-1", NordicUart.notifies, WRITES)
    sensor.refuses = 2
    source, said = make(["left.foot=GARRY-1"], FakeBleak(sensor))
    source._monotonic = own
    async with reading(source) as harness:
        await until(lambda: sensor.is_read)
        for place, line in enumerate(lines(1)):
            own.now_s += 0.01
            if place == 2000:  # it restarts: its clock and count begin anew
                sensor.leave()
                own.now_s += 1.0
                await asyncio.sleep(0.005)
                sensor.is_here = True
                await until(lambda: sensor.is_read)
                for again in lines(1, begin_us=0, seconds=20):
                    own.now_s += 0.01
                    sensor.send(again)
                break
            if place % 50 in (10, 11, 12):
                continue  # lost
            sensor.send(line, part=180)
            if place % 50 == 30:
                sensor.send(line, part=180)  # twice
        strides = harness.strides()
    assert sensor.connections == 2
    assert any("abort" in text for text in said)
    assert any("is gone" in text for text in said)
    lengths = np.array([one.extra["stride_s"] for one in strides if not one.reasons])
    assert len(lengths) >= 20
    assert np.abs(lengths - STRIDE_S).max() < 0.04
    assert all(np.diff([one.time_s for one in strides]) > 0)


async def test_a_silent_connection_is_opened_again(quick):
    sensor = FakeSensor("GARRY-1", NordicUart.notifies, WRITES)
    source, _ = make(["left.foot=GARRY-1"], FakeBleak(sensor))
    async with reading(source):
        await until(lambda: sensor.connections >= 2)


async def test_who_is_not_there_and_what_is_no_sensor(quick):
    watch, dot = FakeSensor("Watch", "0000180d"), FakeSensor("DOT", MovellaDot.notifies)
    source, said = make(["left.foot=Watch", "left.shank=Lost"], FakeBleak(watch, dot))
    async with reading(source):
        await until(lambda: len(said) >= 2)
    assert any("no sensor that GARRY knows" in text for text in said)
    assert any("Lost is not here" in text and "DOT" in text for text in said)


async def test_a_witmotion_is_started_and_says_what_it_cannot_do(quick):
    wit = FakeSensor("WT901BLE", WitMotion.notifies, *WitMotion.start)
    source, said = make(["left.shank=WT901BLE"], FakeBleak(wit))
    async with reading(source):
        await until(lambda: wit.is_read)
        await until(lambda: said)
    assert "cannot be noticed" in said[0]
