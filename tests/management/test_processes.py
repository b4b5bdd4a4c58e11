"""A supervised server that hangs is ended, and one that has ended starts again."""

from __future__ import annotations

import asyncio
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rehab.management.processes import ABORT_S, LOOK_S, PAUSE_S, READY_S, Processes, Server
from rehab.sessions.live.pulse import SILENT_S, keep_pulse, notify

# Reports as a server does; what hangs by itself says where.
REPORTS = """
import faulthandler, time
from rehab.sessions.live.pulse import notify
faulthandler.enable()
notify("READY=1")
def hang_here(): time.sleep(60)
hang_here()
"""
SILENT = "import time; time.sleep(60)"


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[str], Server]]:
    started: list[Server] = []

    def begin(program: str) -> Server:
        server = Server([sys.executable, "-c", program, "8000"], tmp_path / "notify")
        started.append(server)
        server.start(now_s=0.0)
        return server

    yield begin
    for server in started:
        server.process.kill()
        server.process.wait()
        server.close()


def hear(server: Server, now_s: float) -> None:
    until_s = time.monotonic() + 20
    while not server.is_ready():
        assert time.monotonic() < until_s
        server.look(now_s)
        time.sleep(0.01)


def test_a_server_that_is_silent_is_ended_with_its_trace_and_starts_again(start, capfd, caplog):
    server = start(REPORTS)
    hear(server, now_s=10.0)
    first = server.process
    server.look(10.0 + SILENT_S)
    assert first.poll() is None
    server.look(10.1 + SILENT_S)
    assert first.poll() == -signal.SIGABRT
    assert "hang_here" in capfd.readouterr().err
    assert "Server 8000 hangs, and is ended." in caplog.text
    server.look(20.0)
    server.look(20.0 + PAUSE_S)
    assert server.process is first
    server.look(20.1 + PAUSE_S)
    hear(server, now_s=30.0)
    assert server.process is not first


def test_a_server_that_is_frozen_is_ended_too(start):
    server = start(REPORTS)
    hear(server, now_s=10.0)
    server.process.send_signal(signal.SIGSTOP)
    began_s = time.monotonic()
    server.look(10.1 + SILENT_S)
    assert server.process.poll() == -signal.SIGKILL
    assert time.monotonic() - began_s < ABORT_S + 5


def test_a_server_has_longer_to_start_than_to_answer(start):
    server = start(SILENT)
    server.look(READY_S)
    assert server.process.poll() is None
    server.look(READY_S + 0.1)
    assert server.process.poll() is not None


def test_what_an_earlier_server_reported_is_not_the_next_ones(start, monkeypatch):
    server = start(SILENT)
    monkeypatch.setenv("NOTIFY_SOCKET", str(server._address))
    notify("READY=1")
    server.end()
    server.start(now_s=0.0)
    server.look(READY_S)
    assert not server.is_ready()
    assert server.process.poll() is None


def test_a_machine_that_stood_still_ends_no_server(monkeypatch, tmp_path):
    looked: list[float] = []
    clock = iter([100.0, 100.25, 400.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    processes = Processes([["a server"]], tmp_path)
    (server,) = processes._servers
    monkeypatch.setattr(server, "look", lambda now_s: looked.append(server.due_s - now_s))
    server.due_s = 100.0 + SILENT_S
    for _ in range(3):
        processes._look([server])
    server.close()
    assert looked == [SILENT_S, SILENT_S - 0.25, SILENT_S - 0.25 - 2 * LOOK_S]


async def test_the_pulse_is_that_of_the_event_loop(tmp_path, monkeypatch):
    """As systemd hears it; a loop that hangs is silent."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
        supervisor.bind(str(tmp_path / "notify"))
        supervisor.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        shown: list[bool] = []
        pulse = asyncio.create_task(keep_pulse(lambda: shown.append(True)))
        await asyncio.sleep(0.6)
        assert supervisor.recv(100) == b"WATCHDOG=1"
        assert supervisor.recv(100) == b"WATCHDOG=1"
        before = len(shown)
        time.sleep(0.6)  # noqa: ASYNC251 (it hangs)
        assert len(shown) == before
        pulse.cancel()


@pytest.mark.parametrize("address", ["", "/nowhere/at/all", "@garry-nobody-listens"])
def test_a_server_that_nobody_supervises_goes_on(address, monkeypatch):
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    notify("READY=1")
