"""What servers tell each other: once, only to whom it is for, and not long after it was meant."""

from __future__ import annotations

import asyncio
import contextlib
import copy
from collections.abc import AsyncIterator
from typing import Any

import pytest
from channels.layers import InMemoryChannelLayer, channel_layers

from rehab.sessions.live.servers import intercom as intercoms
from rehab.sessions.live.servers.intercom import Intercom, NoAnswer


class RecordingLayer(InMemoryChannelLayer):
    """A layer at which a neighbor records what passes."""

    def __init__(self) -> None:
        super().__init__()
        self.passed: list[tuple[str, Any]] = []
        self.fails = False

    async def send(self, channel: str, message: Any) -> None:
        if self.fails:
            raise ConnectionError
        self.passed.append((channel, copy.deepcopy(message)))
        await super().send(channel, message)


class Room:
    """Servers at one layer, and what they heard."""

    def __init__(self) -> None:
        self.layer = RecordingLayer()
        self.heard: list[tuple[str, str]] = []
        self.servers: list[Intercom] = []

    def open(self, name: str) -> Intercom:
        async def hear(sender: str, data: Any) -> dict[str, Any]:
            self.heard.append((name, data["order"]))
            return {"done": data["order"]}

        self.servers.append(Intercom(name, {"order": hear}))
        return self.servers[-1]


@pytest.fixture
async def room() -> AsyncIterator[Room]:
    made = Room()
    before = channel_layers.set("default", made.layer)
    yield made
    for server in made.servers:
        await server.close()
    channel_layers.set("default", before)


async def test_a_question_is_heard_and_answered(room):
    one, _other = room.open("one"), room.open("other")
    assert (await one.ask("other", "order", {"order": "arm"}))["done"] == "arm"
    assert room.heard == [("other", "arm")]
    with pytest.raises(NoAnswer):
        await one.ask("nobody", "order", {"order": "arm"})


async def test_what_a_neighbor_recorded_is_not_heard_again(room, caplog):
    """It is encrypted, so he cannot write an order of his own; he could repeat one."""
    one, _other = room.open("one"), room.open("other")
    await one.ask("other", "order", {"order": "arm"})
    orders = [message for channel, message in room.layer.passed if message["type"] == "order"]
    for server in ("other", "third"):  # the same one, and one that has never heard any
        if server == "third":
            room.open(server)
        await room.layer.send(f"garry.server.{server}", orders[0])
    await one.ask("other", "order", {"order": "stop"})  # behind those
    await asyncio.sleep(0.01)
    assert room.heard == [("other", "arm"), ("other", "stop")]
    assert caplog.text.count("came again") == 2
    caplog.clear()


async def test_an_order_that_could_not_be_sent_in_time_is_dropped(room, monkeypatch, caplog):
    monkeypatch.setattr(intercoms, "PAUSE_S", 0.05)
    one, _other = room.open("one"), room.open("other")
    room.layer.fails = True
    one.send("other", "order", {"order": "lost with the layer"})
    one.send("other", "order", {"order": "drive"}, within_s=0.02)
    one.send("other", "order", {"order": "change"})
    await asyncio.sleep(0.02)
    room.layer.fails = False
    await asyncio.sleep(0.1)
    assert room.heard == [("other", "change")]


async def test_a_server_ends_where_its_layer_loses_a_cancellation(room, monkeypatch):
    """As redis-py does on Python 3.11, by asyncio.wait_for."""
    sending = asyncio.Event()

    async def send(channel: str, message: Any) -> None:
        sending.set()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.Event().wait()

    monkeypatch.setattr(room.layer, "send", send)
    one = room.open("one")
    one.send("other", "order", {"order": "arm"})
    await sending.wait()
    await asyncio.wait_for(one.close(), 5)
