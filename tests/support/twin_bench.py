"""A twin on a clock that a test moves, and a client that takes its frames apart by hand."""

from __future__ import annotations

import importlib.util
import os
import random
import struct
from functools import reduce
from operator import xor

import pytest

from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.twin.faults import Faults
from robot.bases.twin.firmware import Firmware
from robot.bases.twin.process import Twin

HAS_PHYSICS = importlib.util.find_spec("pybullet") is not None
needs_physics = pytest.mark.skipif(not HAS_PHYSICS, reason="pybullet is not installed")
needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals here")

M_TICK = 1 / 11724.4  # docs/reference/kobuki.md#odometry-and-gyro


def order(speed: int, radius: int) -> bytes:
    """Return a base control command, by the table of docs/reference/kobuki.md#commands."""
    return framed(struct.pack("<BBhh", 1, 4, speed, radius))


def framed(payload: bytes) -> bytes:
    body = bytes((len(payload),)) + payload
    return b"\xaa\x55" + body + bytes((reduce(xor, body),))


def unframe(data: bytes) -> list[bytes]:
    """Take an undamaged stream apart; checksums have to be right."""
    payloads = []
    while data:
        assert data[:2] == b"\xaa\x55"
        end = data[2] + 4
        assert reduce(xor, data[2:end]) == 0
        payloads.append(data[3 : end - 1])
        data = data[end:]
    return payloads


def whole(data: bytes) -> bytes:
    """Leave out what stands before the first and after the last whole frame."""
    data, at = data[data.index(b"\xaa\x55") :], 0
    while at + 3 <= len(data) and at + data[at + 2] + 4 <= len(data):
        at += data[at + 2] + 4
    return data[:at]


def parts(payload: bytes) -> dict[int, bytes]:
    """Return each sub-payload of a payload by its id, in its order."""
    found, at = {}, 0
    while at < len(payload):
        size = payload[at + 1]
        found[payload[at]] = payload[at + 2 : at + 2 + size]
        at += 2 + size
    assert at == len(payload)
    return found


def core(payload: bytes) -> tuple[int, ...]:
    """Return time, bumper, drop, cliff, left, right, 2 pwm, buttons, charger, battery, current."""
    return struct.unpack("<HBBBHHbbBBBB", parts(payload)[1])


def passed(before: int, now: int) -> int:
    return (now - before + 0x8000) % 0x10000 - 0x8000


class Wire:
    """A line that keeps what it is sent."""

    name = "wire"

    def __init__(self):
        self.sent, self.coming, self.is_in = b"", b"", True

    def plug_in(self):
        self.is_in = True

    def pull_out(self):
        self.is_in = False

    def write(self, data):
        self.sent += data if self.is_in else b""

    def read(self):
        data, self.coming = self.coming, b""
        return data

    def wait(self, for_s):
        pass

    def close(self):
        pass


def ideal() -> Faults:
    """Return what no base has: nothing wrong at all, for tests that are about something else."""
    faults = Faults()
    for name in ("drift_deg_min", "gyro_noise_deg_s", "dead_time_s", "lag_s", "stiction_m_s"):
        setattr(faults, name, 0.0)
    return faults


class Bench:
    """A twin whose time is told."""

    def __init__(self, body, **more):
        self.wire, self.now_s = Wire(), 1000.0
        firmware = Firmware(body, ideal(), chance=random.Random(5), **more)
        self.twin = Twin(firmware, self.wire)

    def live(self, for_s, send=b""):
        """Return the payloads of a time [s]; ``send`` goes out at its beginning."""
        self.wire.coming += send
        return unframe(self.live_bytes(for_s))

    def live_bytes(self, for_s):
        for _ in range(round(for_s / FRAME_S)):
            self.now_s += FRAME_S
            self.twin.step(self.now_s)
        sent, self.wire.sent = self.wire.sent, b""
        return sent

    def do(self, what, **more):
        return self.twin.execute({"do": what, **more}, self.now_s)

    @property
    def pose(self):
        return self.twin.firmware.body.pose
