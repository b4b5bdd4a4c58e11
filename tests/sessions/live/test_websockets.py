"""What is overridden of daphne: it still holds, and nobody can fill the server's memory."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosedError
from websockets.frames import Frame, Opcode
from websockets.streams import StreamReader
from websockets.sync.client import connect

from tests.support.servers import ROOT, clean_environment, serve

# In a process of its own: daphne's server installs a reactor.
SCRIPT = """
import asyncio, json, sys
import django
django.setup()
from rehab.sessions.live.daphne_server import LiveServer
from rehab.sessions.live.websockets import MAX_WAITING_BYTES, DirectProtocol

SIZES = json.loads(sys.argv[1])


class Transport:
    reading, told = True, 0
    def pauseProducing(self):
        self.reading, self.told = False, self.told + 1
    def resumeProducing(self):
        self.reading, self.told = True, self.told + 1


async def main():
    received, looked_up = [], asyncio.Event()

    async def application(scope, receive, send):
        await looked_up.wait()
        while True:
            received.append(await receive())

    server = LiveServer(application, endpoints=["tcp:0"])
    protocol = DirectProtocol()
    protocol.client_addr = None
    protocol.transport = transport = Transport()
    server.connections = {protocol: {}}
    protocol.applicationCreateWorked = lambda queue: setattr(protocol, "application_queue", queue)
    protocol.applicationCreateWorked(server.create_application(protocol, {"type": "websocket"}))
    frames = 0
    while transport.reading and frames < 5000:
        protocol.onMessage(b"x" * 60_000, False)
        frames += 1
    looked_up.set()
    while len(received) < frames:
        await asyncio.sleep(0)
    protocol.state = protocol.STATE_OPEN
    frames_sent = []
    protocol.sendData = frames_sent.append
    for size in SIZES:
        protocol.send_text("x" * size)
    protocol.state = protocol.STATE_CLOSING
    protocol.send_text("too late")
    print(json.dumps([data.hex() for data in frames_sent]))
    print(json.dumps([frames * 60_000, MAX_WAITING_BYTES, transport.reading, transport.told]))
    server.connections = {}  # it closed meanwhile
    print(json.dumps(server.create_application(protocol, {"type": "websocket"})))
    beside = asyncio.create_task(asyncio.sleep(60))
    server._hold(beside)
    await server._drain()
    print(json.dumps(beside.cancelled()))

asyncio.run(main())
"""


SIZES = [0, 1, 125, 126, 65_535, 65_536]


@pytest.fixture(scope="module")
def said(tmp_path_factory) -> list[Any]:
    environment = clean_environment(tmp_path_factory.mktemp("server"), 8000)
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", SCRIPT, json.dumps(SIZES)],
        cwd=ROOT,
        env=environment | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert "never awaited" not in done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.server
def test_a_stranger_fills_no_memory_while_being_looked_up(said):
    sent, limit, is_reading, told = said[1]
    assert limit < sent < limit + 2 * 60_000
    assert is_reading
    assert told == 2


@pytest.mark.server
def test_frames_of_every_length_are_whole(said):
    """They are built here, not by autobahn."""
    reader = StreamReader()
    for size, data in zip(SIZES, said[0], strict=True):
        reader.feed_data(bytes.fromhex(data))
        parsing = Frame.parse(reader.read_exact, mask=False)
        with pytest.raises(StopIteration) as done:
            next(parsing)
        frame = done.value.value
        assert (frame.opcode, frame.fin, frame.data) == (Opcode.TEXT, True, b"x" * size)


@pytest.mark.server
def test_a_connection_that_closed_meanwhile_begins_nothing(said):
    """Nor is its application left behind, which Python would warn of."""
    assert said[2] is None


@pytest.mark.server
def test_a_server_that_drains_ends_what_runs_beside_its_connections(said):
    assert said[3] is True


@pytest.mark.server
def test_a_real_server_answers(tmp_path):
    """The versions of daphne, and of what is below, still have what the overrides rest on."""
    with serve(tmp_path) as server:
        with connect(f"ws://127.0.0.1:{server.port}/ws/source/") as socket:
            socket.send(json.dumps({"type": "hello", "token": "é" * 40}))
            assert "Bearer …" in json.loads(socket.recv(10))["message"]
            with pytest.raises(ConnectionClosedError) as closed:
                socket.recv(10)
        assert closed.value.rcvd.code == 4001
