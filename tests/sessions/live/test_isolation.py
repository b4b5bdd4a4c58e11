"""A server that is cut off from the database sends its clients to one that has it."""

from __future__ import annotations

import asyncio
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from types import SimpleNamespace
from typing import Any

import pytest

from rehab.sessions.live import peer_servers as servers_module
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers.isolation_gate import IsolationGate
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.database.server_lease import Server
from rehab.sessions.live.peer_servers import Servers, applies, ask_if_ready
from tests.support.callers import turns

ME, OTHER = Server("me", "me:1", True), Server("other", "other:1", True)


@pytest.mark.parametrize(
    ("answers", "leaves"),
    [
        ([True], True),
        ([False], False),  # the database is gone for all
        ([None], True),  # who hears nobody is cut off itself
        ([False, None], False),
        ([None, True], True),
    ],
)
def test_clients_go_where_the_database_is_or_may_be(answers, leaves):
    assert applies(answers) == leaves


def make_lease() -> Any:
    state = {"is_current": False, "may_judge": False, "is_ready": False}
    return SimpleNamespace(id="me", entered=1, servers=[ME, OTHER], **state)


class World:
    """A server, its lease, and what another one answers."""

    def __init__(self) -> None:
        self.answer: bool | None = True
        self.lease = make_lease()
        self.closed: list[int] = []
        socket = SimpleNamespace(close_soon=self.closed.append)
        clinics = SimpleNamespace(epochs={7: 1})
        self.lost: list[int] = []
        host: Any = SimpleNamespace(sockets=[socket], clinics=clinics, lose=self.lost.append)
        recovery: Any = SimpleNamespace()
        self.servers = Servers(host, recovery, self.lease, ask=lambda _: self.answer)

    async def look(self, times: int = 1) -> bool:
        for _ in range(times):
            await self.servers._watch_database()
        return self.servers.is_isolated


@pytest.fixture
async def world(monkeypatch: pytest.MonkeyPatch) -> World:
    monkeypatch.setattr(servers_module, "BEAT_S", 1000.0)
    world = World()
    await world.servers.close()  # a test has its beats itself
    return world


async def test_a_server_alone_or_with_its_database_keeps_its_clients(world):
    world.lease.servers = [ME]
    assert not await world.look(3)
    world.lease.servers = [ME, OTHER]
    world.lease.is_current = True
    assert not await world.look(3)
    assert not world.closed


async def test_clients_are_sent_away_at_the_second_look_and_once(world):
    assert not await world.look()  # it may be back in a moment
    assert await world.look()
    assert await world.look()
    assert world.closed == [4012]
    world.answer = False
    assert not await world.look()


async def test_nobody_is_admitted_before_what_others_took_is_dropped(world, monkeypatch):
    async def find_taken(epochs: dict[int, int]) -> set[int]:
        return set(epochs)

    monkeypatch.setattr(servers_module, "sync_to_async", lambda function: function)
    monkeypatch.setattr(clinic_owners, "find_taken", find_taken)
    assert await world.look(2)
    world.lease.is_current, world.lease.entered = True, 2
    assert not world.servers.may_move_robots
    assert await world.look()
    await world.servers._beat()
    assert world.lost == [7]
    assert world.servers.may_move_robots
    assert not await world.look()


@pytest.mark.parametrize(("status", "is_ready"), [(200, True), (503, False)])
def test_another_server_is_asked_for_its_state(settings, status, is_ready):
    settings.ALLOWED_HOSTS = [".garry.example"]
    asked: list[Any] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append((self.path, self.headers["Host"]))
            self.send_response(status)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            """Say nothing."""

    with HTTPServer(("127.0.0.1", 0), Handler) as other:
        threading.Thread(target=other.handle_request).start()
        address = f"127.0.0.1:{other.server_port}"
        assert ask_if_ready(address) is is_ready
    assert asked == [("/readyz", "garry.example")]
    assert ask_if_ready(address) is None


async def ask(scope: dict[str, Any]) -> list[dict[str, Any]]:
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": f"{scope['type']}.connect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    async def inner(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "inner"})

    await IsolationGate(inner)(scope, receive, send)
    return sent


@pytest.mark.parametrize(
    ("scope", "first"),
    [
        ({"type": "http", "path": "/"}, {"type": "http.response.start", "status": 504}),
        ({"type": "http", "path": "/readyz"}, {"type": "inner"}),
        ({"type": "http", "path": "/livez"}, {"type": "http.response.start", "status": 503}),
        ({"type": "websocket", "path": "/ws/source/"}, {"type": "websocket.accept"}),
    ],
)
async def test_nobody_but_a_watchdog_gets_in(monkeypatch, scope, first):
    servers = SimpleNamespace(is_isolated=True)
    live = SimpleNamespace(servers=servers, is_ready=True)
    monkeypatch.setattr(runtimes, "peek", lambda: live)
    sent = await ask(scope)
    assert first.items() <= sent[0].items()
    if scope["type"] == "websocket":  # so it connects again, and the proxy asks another server
        assert sent[1] == {"type": "websocket.close", "code": 4012}
    servers.is_isolated = False
    live.servers = servers if scope["path"] == "/" else None
    if scope["path"] != "/livez":
        assert await ask(scope) == [{"type": "inner"}]
        return
    assert (await ask(scope))[0]["status"] == 200
    live.is_ready = False
    assert (await ask(scope))[0]["status"] == 503
    monkeypatch.setattr(runtimes, "peek", lambda: None)  # it is starting, or stopping
    assert (await ask(scope))[0]["status"] == 503


async def test_no_robot_hears_a_server_whose_clinics_another_may_have(place, begun, monkeypatch):
    """It stands still after 0.65 s, whatever it does and whoever drives it."""
    session = await begun(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    runtime = runtimes.current()
    await runtime.routines.stop()
    state = SimpleNamespace(may_move_robots=True, close=lambda: asyncio.sleep(0))
    monkeypatch.setattr(runtime, "servers", state)
    drive = {"type": "robot", "order": "drive", "ahead": 1, "left": 0}

    async def heard() -> set[str]:
        await monitor.say(drive)
        for _ in range(3):
            await runtime.routines._send_robot_heartbeats()
        await turns()
        return {message["type"] for message in await robot.overhear()}

    assert {"drive", "heartbeat"} <= await heard()
    state.may_move_robots = False
    assert await heard() == set()
    await monitor.say({"type": "robot", "order": "stop"})  # a stop always counts
    await robot.hear("stop")
