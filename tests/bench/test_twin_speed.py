"""How fast the twin is unpaced, against the bare physics of the same run; what it costs paced."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from statistics import median

import psutil
import pytest

pytest.importorskip("pybullet", reason="pybullet is not installed")

from robot.bases.kobuki_protocol.commands import BaseControl, encode_commands
from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.kobuki_protocol.wheels import control_to_twist, slow_to_wheels
from robot.bases.twin.bullet import STEPS, BulletBody
from robot.bases.twin.faults import Faults
from robot.bases.twin.firmware import Firmware

pytestmark = pytest.mark.bench

REPEATS = 7
FRAMES = 1500  # 30 s of the twin's time
# There and back, on the spot and round: a command for every frame, as a driver sends them.
RUN = [(200, 0), (207, 1), (258, 400), (-200, 0), (-207, 1)]
PACED_S = 10.0


def ordered(number: int) -> BaseControl:
    return BaseControl(*RUN[number * len(RUN) // FRAMES])


def run_twin() -> float:
    """Time the whole twin: bytes in, physics, touch, bytes out."""
    firmware = Firmware(BulletBody(FRAME_S), Faults(), chance=random.Random(1))
    commands = [encode_commands(ordered(number)) for number in range(FRAMES)]
    began_s = time.perf_counter()
    for number, command in enumerate(commands):
        firmware.receive(command, number * FRAME_S)
        firmware.step(number * FRAME_S)
    return time.perf_counter() - began_s


def run_floor() -> float:
    """Time stepSimulation alone on the same body, its wheels ordered the same way."""
    body = BulletBody(FRAME_S)
    firmware = Firmware(body, Faults(), chance=random.Random(1))
    spent_s, step = 0.0, body._step
    was = None
    for number in range(FRAMES):
        if ordered(number) != was:
            was = firmware.control = ordered(number)
            body.roll(*slow_to_wheels(control_to_twist(firmware.control)).wheels_m_s)
        began_s = time.perf_counter()
        for _ in range(STEPS):
            step()
        spent_s += time.perf_counter() - began_s
    return spent_s


def test_the_twin_costs_little_more_than_its_physics():
    pairs = [(run_floor(), run_twin()) for _ in range(REPEATS)]
    floor_s, twin_s = median(floor for floor, _ in pairs), median(twin for _, twin in pairs)
    share = median(floor / twin for floor, twin in pairs)
    print(
        f"\nbare stepSimulation {FRAMES * STEPS / floor_s:,.0f} steps/s; "
        f"twin {FRAMES * STEPS / twin_s:,.0f} steps/s, "
        f"{FRAMES * FRAME_S / twin_s:.0f} × real time: {share:.2f} of the bare loop"
    )
    assert share >= 0.6


@pytest.mark.parametrize("line", ["pty", "socket"])
def test_the_twin_at_its_pace_leaves_the_computer_alone(line):
    serial = pytest.importorskip("serial")
    words = [sys.executable, "-m", "robot", "twin", "--child", "--line", line, "--body", "bullet"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as twin:
        name = twin.stdout.readline().strip()
        with serial.serial_for_url(name, timeout=0.1) as port:
            process = psutil.Process(twin.pid)
            until_s = time.monotonic() + 1  # what starting cost is not its pace
            heard = 0
            while time.monotonic() < until_s:
                port.read(81)
            before, began_s = process.cpu_times(), time.monotonic()
            number = 0
            while time.monotonic() - began_s < PACED_S:
                heard += len(port.read(81))
                port.write(encode_commands(ordered(number % FRAMES)))
                number += 1
            after, passed_s = process.cpu_times(), time.monotonic() - began_s
        twin.stdin.close()
        twin.wait(10)
    spent_s = after.user + after.system - before.user - before.system
    print(f"\n{line}: {spent_s / passed_s:.1%} of a core paced, {heard / 84 / passed_s:.1f} Hz")
    assert spent_s / passed_s <= 0.05
