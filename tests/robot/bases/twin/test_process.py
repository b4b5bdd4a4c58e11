"""The twin's process: its ports, its orders, its end."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.twin_bench import (
    M_TICK,
    core,
    needs_pty,
    order,
    passed,
    unframe,
    whole,
)


class Process:
    """`python -m robot twin`, its orders and its answers."""

    def __init__(self, *words):
        self.child = subprocess.Popen(
            [sys.executable, "-m", "robot", "twin", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.port = self.child.stdout.readline().strip()

    def do(self, what, **more):
        self.child.stdin.write(json.dumps({"do": what, **more}) + "\n")
        self.child.stdin.flush()
        return json.loads(self.child.stdout.readline())

    def end(self):
        self.child.send_signal(signal.SIGTERM)
        assert self.child.wait(10) == 0
        self.child.stdin.close()
        self.child.stdout.close()


@pytest.fixture
def start():
    started = []

    def start(*words):
        started.append(Process(*words))
        return started[-1]

    yield start
    for process in started:
        process.end()


def read_all(read, for_s):
    data, until_s = b"", time.monotonic() + for_s
    while time.monotonic() < until_s:
        data += read()
    return data


@pytest.mark.realtime
@needs_pty
def test_a_byte_client_hears_it_at_a_pty(start):
    twin = start()
    port = os.open(twin.port, os.O_RDWR | os.O_NOCTTY)
    os.write(port, order(200, 0))
    began_s = time.monotonic()
    data = read_all(lambda: os.read(port, 4096), 2)
    frames = unframe(whole(data))
    rate_hz = len(frames) / (time.monotonic() - began_s)
    print(f"\n{rate_hz:.1f} Hz")
    times = [core(frame)[0] for frame in frames]
    assert {passed(*two) for two in pairwise(times)} == {20}
    assert rate_hz == pytest.approx(50, abs=8)  # what had not been read before is in it
    rolled_m = passed(core(frames[-51])[5], core(frames[-1])[5]) * M_TICK
    assert rolled_m == pytest.approx(0.2, rel=0.01)
    os.close(port)
    folder = Path(twin.port).parent
    twin.do("vanish", for_s=0.3)
    assert not Path(twin.port).exists()
    until_s = time.monotonic() + 5
    while not Path(twin.port).exists() and time.monotonic() < until_s:
        time.sleep(0.02)
    assert Path(twin.port).exists()
    twin.child.terminate()
    twin.child.wait(10)
    assert not folder.exists()


@pytest.mark.realtime
def test_a_byte_client_hears_it_at_a_socket(start):
    twin = start("--line", "socket", "--body", "kinematic")
    host, port = twin.port.removeprefix("socket://").split(":")
    with socket.create_connection((host, int(port)), 5) as driver:
        driver.sendall(order(200, 0))
        frames = unframe(whole(read_all(lambda: driver.recv(4096), 1)))
        assert len(frames) == pytest.approx(50, abs=4)
        with socket.create_connection((host, int(port)), 5) as second:
            assert second.recv(1) == b""  # one driver at a time
        driver.sendall(order(0, 0))
        driver.recv(4096)
        look = twin.do("look")
        assert [control[1:] for control in look["orders"]] == [[200, 0], [0, 0]]
        assert look["body"] == "KinematicBody"
        assert "--help" in twin.do("sing")["error"]
        twin.child.stdin.write("{\n")
        assert "error" in twin.do("look")  # what came first was no JSON
        assert "pose" in json.loads(twin.child.stdout.readline())
    with socket.create_connection((host, int(port)), 5) as driver:
        assert driver.recv(2) == b"\xaa\x55"


@pytest.mark.server
def test_as_a_child_it_ends_with_its_parent():
    twin = Process("--child", "--line", "socket", "--body", "kinematic")
    twin.child.stdin.close()
    assert twin.child.wait(10) == 0
    twin.child.stdout.close()
