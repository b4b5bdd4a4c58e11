"""A server that is cut off from the database sends its clients to one that has it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers.isolation_gate import IsolationGate
from rehab.sessions.live.servers.isolation import Isolation

OTHER = {"other"}


class World:
    """A server's lease, and the time."""

    def __init__(self) -> None:
        self.now_s = 100.0
        lease: Any = SimpleNamespace(is_current=False)
        self.lease = lease
        self.isolation = Isolation(lease, lambda: self.now_s)

    def applies(self, others: set[str] = OTHER, *, is_silent: bool = False) -> bool:
        return self.isolation.applies(others, is_silent=is_silent)


@pytest.fixture
def world() -> World:
    return World()


def test_clients_stay_while_the_database_answers_or_is_gone_for_all(world):
    assert not world.applies()  # the other one does not say that it has it
    world.isolation.record("other", is_current=False)
    assert not world.applies()
    world.isolation.record("other", is_current=True)
    assert world.applies()
    world.lease.is_current = True
    assert not world.applies(is_silent=True)


def test_who_hears_nobody_is_cut_off_itself(world):
    assert world.applies(is_silent=True)
    assert not world.applies(set(), is_silent=True)  # one server alone keeps its clients


def test_what_another_said_counts_for_three_seconds(world):
    world.isolation.record("other", is_current=True)
    world.now_s += 2.9
    assert world.applies()
    world.now_s += 0.2
    assert not world.applies()
    world.isolation.record("other", is_current=True)
    world.isolation.record("other", is_current=False)
    assert not world.applies()
    assert not world.applies({"a third"})


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
        ({"type": "websocket", "path": "/ws/source/"}, {"type": "websocket.close"}),
    ],
)
async def test_nobody_but_a_watchdog_gets_in(monkeypatch, scope, first):
    servers = SimpleNamespace(is_isolated=True)
    monkeypatch.setattr(runtimes, "peek", lambda: SimpleNamespace(servers=servers))
    sent = await ask(scope)
    assert first.items() <= sent[0].items()
    servers.is_isolated = False
    assert await ask(scope) == [{"type": "inner"}]
    monkeypatch.setattr(runtimes, "peek", lambda: SimpleNamespace(servers=None))
    assert await ask(scope) == [{"type": "inner"}]
