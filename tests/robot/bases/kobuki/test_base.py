"""A Kobuki over its port: where it is, what it feels, and what becomes of it when things break."""

import math
import os
import signal
import sys
import time
from contextlib import contextmanager

import psutil
import pytest

from robot.bases.base import Indication
from robot.bases.kobuki import KobukiBase
from robot.bases.kobuki_protocol.commands import (
    GpOutput,
    Output,
    Sound,
    SoundSequence,
    decode_commands,
)
from robot.bases.kobuki_protocol.frames import FrameReader
from robot.motion.lights_and_sounds import Color, Melody, Note
from robot.motion.pose import HOME, Pose
from robot.motion.twist import STILL, Twist
from tests.support.extent import EVERYTHING
from tests.support.fake_kobuki import FakeKobuki

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pty")

TICK_S = 0.02


@contextmanager
def driving(url):
    base = KobukiBase(time.monotonic)
    base.port = url
    with base:
        yield base


@pytest.fixture
def kobuki():
    with FakeKobuki() as kobuki:
        yield kobuki


@pytest.fixture
def base(kobuki):
    with driving(kobuki.url) as base:
        yield base


def drive(base, twist, for_s):
    end_s = time.monotonic() + for_s
    while time.monotonic() < end_s:
        base.drive(twist)
        time.sleep(TICK_S)


def until(base, holds, within_s=8.0):
    """Order it to stand until something holds, as a worker does."""
    end_s = time.monotonic() + within_s
    while not holds(base.read().sensors):
        assert time.monotonic() < end_s, base.read()
        base.stop()
        time.sleep(TICK_S)


def owner_of(base):
    return base._client._process.pid


@pytest.mark.essential
@pytest.mark.realtime
@pytest.mark.parametrize(
    "twist",
    [Twist(0.2, 0), Twist(-0.2, 0), Twist(0, 1.5), Twist(0, -1.5), Twist(0.15, -0.8)],
    ids=str,
)
def test_it_goes_where_it_is_told_over_wraps_of_all_counters(kobuki, base, twist):
    began_s = time.monotonic()
    drive(base, twist, 0.8)
    base.stop()
    kobuki.until(lambda: not kobuki.is_moving)
    # How far that is depends on how busy this machine is, where it is then does not.
    longest_s = time.monotonic() - began_s + 2 * TICK_S
    until(base, lambda _: base.read().twist == STILL)
    until(base, lambda _: abs(base.read().pose.heading_rad - kobuki.heading_rad) < 0.01)
    state = base.read()
    assert state.pose.distance_m(Pose(kobuki.x_m, kobuki.y_m)) < 0.002
    along_m = state.pose.distance_m(HOME)
    for gone, speed in (
        (state.pose.heading_rad, twist.w_rad_s),
        (math.copysign(along_m, state.pose.x_m), twist.v_m_s),
    ):
        way = gone * math.copysign(1, speed) if speed else abs(gone)
        assert 0.2 * abs(speed) - 0.001 <= way <= longest_s * abs(speed) + 0.001
    assert abs(state.sensors.slip_rad) < 0.02
    assert state.twist == STILL
    base.set_home()
    assert base.read().pose == HOME


@pytest.mark.parametrize("hazard", ["bump", "cliff", "wheel_drop", "over_current"])
def test_what_it_feels(kobuki, base, hazard):
    setattr(kobuki, {"bump": "bumper"}.get(hazard, hazard), 1)
    until(base, lambda sensors: sensors.hazards == {hazard})
    setattr(kobuki, {"bump": "bumper"}.get(hazard, hazard), 0)
    until(base, lambda sensors: not sensors.hazards)


# Of each process: 100 of 100 in all where everything is tried.
BUMPS = 50 if EVERYTHING else 8


@pytest.mark.realtime
@pytest.mark.parametrize("who", ["program", "port"])
def test_a_bump_of_50_ms_in_a_hang_of_200_ms_is_never_lost(kobuki, base, who):
    lost, rounds, number = [], 0, 0
    while rounds < BUMPS:
        drive(base, STILL, 0.1)
        until(base, lambda sensors: not sensors.hazards)
        before_s, number = (number % 10) * 0.015, number + 1
        hangs_s, restarts = time.monotonic(), base.counters["port_restarts"]
        owner = psutil.Process(owner_of(base))
        if who == "port":
            owner.suspend()
        time.sleep(before_s)
        kobuki.bumper = 1 + number % 3
        frames = kobuki.frames
        time.sleep(0.05)
        told = kobuki.frames - frames
        kobuki.bumper = 0
        time.sleep(0.15 - before_s)
        if who == "port":
            owner.resume()
        hung_s = time.monotonic() - hangs_s
        base.stop()
        if hung_s > 0.25 or told < 2 or base.counters["port_restarts"] > restarts:
            until(base, lambda sensors: sensors.silent_s < 0.1)  # this machine hung as well
            continue
        rounds += 1
        try:
            until(base, lambda sensors: "bump" in sensors.hazards, within_s=1.0)
        except AssertionError:
            lost.append(number)
    assert not lost


@pytest.mark.realtime
def test_another_program_that_drives_it_is_noticed(kobuki, base):
    drive(base, Twist(0.2, 0), 0.2)
    drive(base, STILL, 1.2)
    assert not base.read().sensors.hazards
    kobuki.is_driven = True
    until(base, lambda sensors: "unordered_motion" in sensors.hazards, within_s=1.0)


def test_its_button_and_its_charger(kobuki, base):
    kobuki.buttons, kobuki.charger, kobuki.battery = 1, 6, 133
    until(base, lambda sensors: sensors.stop_pressed)
    until(base, lambda sensors: sensors.is_charging and sensors.battery_v == 13.3)
    kobuki.buttons = 4
    until(base, lambda sensors: not sensors.stop_pressed)


def test_lights_and_sounds_never_cut_the_power(kobuki, base):
    for indication in Indication:
        base.show(indication, aloud=True)
        until(base, lambda sensors: sensors.refusal == "")
        drive(base, STILL, 0.06)
    lights = {0x00F0, 0x01F0, 0x02F0, 0x03F0}
    kobuki.until(lambda: set(kobuki.outputs) >= lights)
    assert set(kobuki.outputs) == lights
    assert kobuki.melodies == [4]  # a gesture has notes of its own
    assert kobuki.bad == 0


def extras(base):
    """Return what goes out beside the next order, but for requests."""
    frames = FrameReader(decode_commands).feed(base._extra_commands())
    kinds = (GpOutput, Sound, SoundSequence)
    return [command for frame in frames for command in frame if isinstance(command, kinds)]


def test_lights_notes_and_melodies_are_a_kobuki_s():
    base = KobukiBase(lambda: 5.0)
    extras(base)
    base.light(Color.ORANGE, Color.GREEN)
    base.play(Note(0.0, 440.0, 0.2))
    assert extras(base) == [
        Sound(826, 200),
        GpOutput(Output.POWER | Output.LED1_ORANGE | Output.LED2_GREEN),
    ]
    base.play(Note(0.0, melody=Melody.CLEANING_END))
    assert extras(base) == [SoundSequence(6)]
    base.show(Indication.READY, aloud=False)
    assert extras(base) == [GpOutput(Output.POWER | Output.LED1_GREEN)]


@pytest.mark.parametrize(
    ("version", "refusal"),
    [
        ((1, 0, 0), ""),
        ((1, 1, 4), ""),
        ((2, 0, 0), "firmware_refused"),
        ((0, 0, 1), "firmware_refused"),
    ],
)
def test_firmware_that_it_was_not_made_for(version, refusal):
    with FakeKobuki(version=version) as kobuki, driving(kobuki.url) as base:
        until(base, lambda sensors: sensors.refusal != "firmware_unknown")
        assert base.read().sensors.refusal == refusal


def test_a_base_that_falls_silent(kobuki, base):
    kobuki.is_mute = True
    until(base, lambda sensors: sensors.silent_s > 0.2)
    kobuki.is_mute = False
    until(base, lambda sensors: sensors.silent_s < 0.1)


@pytest.mark.realtime
def test_a_base_that_is_switched_off_and_on_jumps_nowhere(kobuki, base):
    drive(base, Twist(0.2, 0.5), 0.4)
    there = base.read().pose
    kobuki.restart()
    until(base, lambda sensors: "restarted" in sensors.hazards)
    assert base.read().pose.distance_m(there) < 0.02
    assert abs(base.read().pose.heading_rad - there.heading_rad) < 0.05


@pytest.mark.essential
@pytest.mark.realtime
def test_a_port_that_vanishes_and_comes_back(tmp_path):
    """It comes back stopped, from where it was, and goes on only after an order to stand."""
    port = tmp_path / "kobuki"
    with FakeKobuki() as kobuki:
        port.symlink_to(kobuki.url)
        with driving(str(port)) as base:
            drive(base, Twist(0.2, 0), 0.3)
            there = base.read().pose
            kobuki.unplug()
            end_s = time.monotonic() + 3
            while not base.problem:
                base.drive(Twist(0.2, 0))
                assert time.monotonic() < end_s
                time.sleep(TICK_S)
            port.unlink()
            with FakeKobuki() as again:
                port.symlink_to(again.url)
                end_s = time.monotonic() + 5
                while base.counters["port_openings"] < 2 or base.counters["port_refused"] < 5:
                    base.drive(Twist(0.2, 0))
                    assert time.monotonic() < end_s
                    time.sleep(TICK_S)
                again.until(lambda: len(again.orders) >= 3)
                assert not any(speed for _, speed, _ in again.orders)
                until(base, lambda sensors: sensors.silent_s < 0.1 and not sensors.refusal)
                assert base.read().pose.distance_m(there) < 0.03
                drive(base, Twist(0.1, 0), 0.2)
                assert again.is_moving


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("how", "within_s"),
    [(signal.SIGKILL, 0.2), (signal.SIGSTOP, 0.5)],  # it may be silent for 0.3 s
    ids=["SIGKILL", "SIGSTOP"],
)
def test_a_port_process_that_dies_or_hangs_is_replaced_and_the_base_stopped(
    kobuki, base, how, within_s
):
    drive(base, Twist(0.2, 0), 0.3)
    first = owner_of(base)
    since_s = time.monotonic()
    os.kill(first, how)
    drive(base, Twist(0.2, 0), 1.5)
    assert owner_of(base) != first
    assert base.counters["port_restarts"] == 1
    assert kobuki.moved_after(since_s) <= within_s
    assert not kobuki.is_moving  # until an order to stand has come
    drive(base, STILL, 0.1)
    drive(base, Twist(0.2, 0), 0.2)
    assert kobuki.is_moving


@pytest.mark.realtime
def test_a_port_process_that_hangs_at_the_end_is_killed_and_the_base_stopped(kobuki):
    with driving(kobuki.url) as base:
        drive(base, Twist(0.2, 0), 0.3)
        os.kill(owner_of(base), signal.SIGSTOP)
    kobuki.until(lambda: [speed for _, speed, _ in kobuki.orders[-3:]] == [0, 0, 0], within_s=1.0)


@pytest.mark.realtime
def test_a_lost_base_is_stopped_although_the_port_process_hung_at_the_end(tmp_path):
    port = tmp_path / "kobuki"
    with FakeKobuki() as kobuki:
        port.symlink_to(kobuki.url)
        with driving(str(port)) as base:
            drive(base, Twist(0.2, 0), 0.3)
            port.unlink()
            kobuki.unplug()
            kobuki.until(lambda: "switch it off" in base.problem)
            os.kill(owner_of(base), signal.SIGSTOP)
            time.sleep(1.0)
    with FakeKobuki() as again:
        port.symlink_to(again.url)
        again.until(lambda: len(again.orders) >= 3)
        assert not any(speed for _, speed, _ in again.orders)


@pytest.mark.essential
@pytest.mark.realtime
def test_leaving_it_stops_it(kobuki):
    with driving(kobuki.url) as base:
        drive(base, Twist(0.2, 0), 0.3)
        owner = owner_of(base)
        since_s = time.monotonic()
    time.sleep(0.05)
    assert kobuki.moved_after(since_s) <= 0.1
    with pytest.raises(ProcessLookupError):
        os.kill(owner, 0)


def test_a_port_that_is_not_there_says_so(tmp_path):
    with driving(str(tmp_path / "nothing")) as base:
        assert "could not open port" in base.problem
        assert base.read().sensors.silent_s > 1
        assert base.read().twist == STILL
