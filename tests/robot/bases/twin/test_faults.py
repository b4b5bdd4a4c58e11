"""Faults that a twin can be given."""

from __future__ import annotations

import math
import struct
import sys

import pytest

from robot.bases.kobuki_protocol.feedback import decode_feedback
from robot.bases.kobuki_protocol.frames import FRAME_S, FrameReader
from robot.bases.twin.__main__ import make_body, make_parser
from robot.bases.twin.bodies import KinematicBody
from robot.bases.twin.faults import LIMITS, BadFault, Faults
from robot.bases.twin.firmware import FIRMWARE
from tests.support.twin_bench import (
    M_TICK,
    core,
    order,
    parts,
    passed,
)

pytestmark = pytest.mark.matrix


@pytest.mark.parametrize(
    ("name", "value", "place"),
    [
        ("bumper", 5, 1),
        ("wheel_drop", 3, 2),
        ("cliff", 2, 3),
        ("buttons", 1, 8),
        ("charger", 22, 9),
        ("over_current", 1, 11),
    ],
)
def test_what_it_feels_can_be_made_up_for_a_while(simple, name, value, place):
    simple.do("set", name=name, value=value, for_s=0.5)
    felt = [core(frame)[place] for frame in simple.live(1)]
    assert felt[:24] == [value] * 24
    assert felt[-24:] == [0] * 24


def test_a_newer_fault_takes_the_place_of_an_older_one(simple):
    simple.do("set", name="bumper", value=1, for_s=0.5)
    simple.do("set", name="bumper", value=2, for_s=1)
    assert core(simple.live(0.6)[-1])[1] == 2
    assert core(simple.live(0.6)[-1])[1] == 0
    simple.do("set", name="bumper", value=1, for_s=0.5)
    simple.do("set", name="bumper", value=4)
    assert core(simple.live(1)[-1])[1] == 4


def test_a_battery_runs_low(simple):
    simple.do("set", name="battery_v", value=13.2)
    assert core(simple.live(1)[-1])[10] == 132


@pytest.mark.parametrize("way", [1, -1])
def test_a_wheel_may_be_larger_than_it_believes(bench, way):
    bench.do("set", name="left_scale", value=1.02)
    bench.do("set", name="right_scale", value=0.99)
    frames = bench.live(1.2, order(200 * way, 0))[10:]
    seconds = passed(core(frames[0])[0], core(frames[-1])[0]) / 1000
    for wheel in (4, 5):
        rolled_m = passed(core(frames[0])[wheel], core(frames[-1])[wheel]) * M_TICK
        assert rolled_m / seconds == pytest.approx(0.2 * way, rel=0.005)
    # 6 mm/s more on the left, at a distance of 0.23 m.
    assert bench.pose.heading_rad == pytest.approx(-0.006 * 1.2 / 0.23 * way, rel=0.05)
    (angle,) = struct.unpack("<h", parts(frames[-1])[4][:2])
    assert math.radians(angle / 100) == pytest.approx(bench.pose.heading_rad, abs=1e-3)


def test_a_gyro_drifts(simple):
    simple.do("set", name="drift_deg_min", value=2)
    angle, rate = struct.unpack("<hh3x", parts(simple.live(30)[-1])[4])
    assert (angle, rate) == (100, 3)


@pytest.mark.parametrize(
    ("name", "length"), [("drop", 0.95), ("flip", 1), ("duplicate", 1.05)], ids=str
)
def test_bytes_are_damaged(simple, name, length):
    whole = sum(map(len, simple.live(20))) + 4 * 1000
    simple.do("set", name=name, value=0.05)
    damaged = simple.live_bytes(20)
    assert len(damaged) / whole == pytest.approx(length, abs=0.01)
    reader = FrameReader(decode_feedback)
    assert len(reader.feed(damaged)) < 100
    assert reader.bad_checksums > 500


def test_false_headers_come_in_between(simple):
    simple.do("set", name="false_header", value=0.5)
    assert simple.live_bytes(20).count(b"\xaa\x55\xaa\x55") == pytest.approx(500, abs=100)


def test_orders_are_damaged_too(simple):
    simple.do("set", name="drop", value=0.1)
    for _ in range(100):
        simple.wire.coming += order(100, 0)
        simple.live_bytes(FRAME_S)
    look = simple.do("look")
    assert 10 < len(look["orders"]) < 60
    assert look["bad_commands"] > 0


def test_a_stall_holds_everything_back(simple):
    simple.live(0.1)
    simple.do("stall", for_s=0.5)
    assert simple.live(0.46, order(200, 0)) == []
    assert simple.pose.x_m == 0
    late = simple.live(0.1)
    assert len(late) == 28
    assert simple.pose.x_m > 0


def test_a_port_vanishes_and_comes_back(simple):
    simple.do("vanish", for_s=0.5)
    simple.do("vanish", for_s=1)
    simple.live(0.6)
    assert not simple.wire.is_in
    simple.live(0.6)
    assert simple.wire.is_in


def test_a_power_cycle_begins_all_counters_at_0(simple):
    simple.live(5, order(200, 0))
    simple.do("power_cycle", for_s=1)
    assert simple.live(0.9, order(200, 0)) == []
    frames = simple.live(0.5)
    assert core(frames[0])[0] == 20
    assert core(frames[-1])[4:6] == (0, 0)
    assert simple.do("look")["setpoint"] == (0, 0)
    assert simple.pose.x_m == pytest.approx(1.0)


def test_it_is_carried_home_unnoticed(bench):
    before = bench.live(1, order(258, 400))[-1]
    bench.live(0.5, order(0, 0))
    before = bench.live(FRAME_S)[-1]
    bench.do("carry_home")
    assert bench.pose.distance_m(type(bench.pose)()) < 0.001
    after = bench.live(0.2)[-1]
    assert abs(passed(core(before)[4], core(after)[4])) < 15
    angle_was, angle = (struct.unpack("<h", parts(frame)[4][:2])[0] for frame in (before, after))
    assert abs(angle - angle_was) < 20


def test_it_can_be_looked_at(simple):
    simple.live(1, order(200, 0))
    look = simple.do("look")
    assert look["pose"] == {"x_m": pytest.approx(0.2), "y_m": 0, "heading_rad": 0}
    assert look["farthest_m"] == pytest.approx(0.2)
    assert look["orders"] == [(pytest.approx(1000.02), 200, 0)]
    assert simple.do("look")["orders"] == []


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"do": "fly"},
        {"do": "set", "name": "luck", "value": 1},
        {"do": "set", "name": "bumper", "value": 8},
        {"do": "set", "name": "bumper", "value": 0.5},
        {"do": "set", "name": "bumper", "value": True},
        {"do": "set", "name": "drop", "value": "often"},
        {"do": "set", "name": "drop", "value": math.nan},
        {"do": "set", "name": "bumper", "value": 1, "for_s": "long"},
        {"do": "stall"},
        {"do": "stall", "for_s": -1},
        {"do": "wall", "ahead_m": None},
    ],
    ids=str,
)
def test_what_cannot_be_done_is_refused(simple, wrong):
    with pytest.raises(BadFault):
        simple.twin.execute(wrong, 0.0)


def test_each_fault_has_limits_and_an_option():
    options = vars(make_parser().parse_args([]))
    for name, value in vars(Faults()).items():
        assert LIMITS[name][0] <= value <= LIMITS[name][1]
        assert options[name] == value
    assert options["firmware"] == FIRMWARE


def test_without_pybullet_it_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    said: list[str] = []
    assert isinstance(make_body("auto", said.append), KinematicBody)
    assert "pybullet" in said[0]
    with pytest.raises(ImportError):
        make_body("bullet", said.append)
