"""uvicorn's texts, handled as they come or queued: each once, in order, however TCP cuts them."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

import pytest
from uvicorn import Config
from uvicorn.server import ServerState
from websockets.frames import Frame, Opcode

from rehab.sessions.live.protocol.frames import READ_NOW
from rehab.sessions.live.uvicorn_server import DirectProtocol
from tests.support.callers import turns

HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
TEXTS = ["one", "é" * 100, "three", "4", "five"]


class Transport:
    """What a protocol needs of one; it sends to nobody."""

    def get_extra_info(self, name: str) -> None:
        return None

    def is_closing(self) -> bool:
        return False

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


def stream() -> bytes:
    """Return the texts as a client's frames: a ping among them, the last one in two parts."""
    frames = [Frame(Opcode.TEXT, text.encode()) for text in TEXTS[:-1]]
    frames.insert(2, Frame(Opcode.PING, b"there?"))
    frames += [Frame(Opcode.TEXT, b"fi", fin=False), Frame(Opcode.CONT, b"ve")]
    return b"".join(frame.serialize(mask=True) for frame in frames)


async def shake_hands(application: Any) -> DirectProtocol:
    """Return the server's side of a connection to an application."""
    config = Config(application, lifespan="off", log_config=None)
    protocol = DirectProtocol(config, ServerState(), {}, asyncio.get_running_loop())
    protocol.connection_made(Transport())  # type: ignore[arg-type]
    protocol.data_received(HANDSHAKE)
    await turns()
    return protocol


def keep(taken: list[str], text: str) -> bool:
    taken.append(text)
    return True


@pytest.mark.parametrize("taken_chars", [[], [1, 3, 5, 100], [3, 5]], ids=["none", "all", "some"])
@pytest.mark.parametrize("patient", [True, False])
async def test_texts_come_once_and_in_order(taken_chars, patient):
    for size in (*range(1, 40), 10_000):
        got: list[str] = []

        def take(text: str, got: list[str] = got) -> bool:
            if len(text) in taken_chars:
                got.append(text)
            return len(text) in taken_chars

        async def application(
            scope: Any, receive: Any, send: Any, got: list[str] = got, take: Any = take
        ) -> None:
            scope["extensions"][READ_NOW](take)
            while (message := await receive())["type"] != "websocket.disconnect":
                if message["type"] == "websocket.connect":
                    await send({"type": "websocket.accept"})
                else:
                    got.append(message["text"])

        protocol = await shake_hands(application)
        data = stream()
        for begin in range(0, len(data), size):
            protocol.data_received(data[begin : begin + size])
            if patient:
                await turns(3)
        await turns()
        assert got == TEXTS
        protocol.connection_lost(None)
        await turns()


async def test_a_frame_inside_a_texts_bytes_is_no_message():
    """Whoever chooses the mask chooses the bytes: here a part of a text looks like a whole one."""
    mask = b"\x80" * 4
    inner = bytes((0x81, 0x85)) + mask + bytes(0x80 | byte for byte in b"inner")
    text = bytes(byte ^ 0x80 for byte in b"\xe1" + inner + b"\xe2")
    pieces = [bytes((0x81, 0x80 | len(text))) + mask + b"\xe1", inner, b"\xe2"]
    got: list[str] = []

    async def application(scope: Any, receive: Any, send: Any) -> None:
        scope["extensions"][READ_NOW](partial(keep, got))
        await receive()
        await send({"type": "websocket.accept"})
        got.append((await receive())["text"])
        await receive()

    protocol = await shake_hands(application)
    for piece in pieces:
        protocol.data_received(piece)
        await turns(3)
    assert got == [text.decode()]
    protocol.connection_lost(None)
    await turns()


async def test_whole_texts_are_taken_past_the_queue():
    taken: list[str] = []

    async def application(scope: Any, receive: Any, send: Any) -> None:
        scope["extensions"][READ_NOW](partial(keep, taken))
        await receive()
        await send({"type": "websocket.accept"})
        assert (await receive())["type"] == "websocket.disconnect"

    protocol = await shake_hands(application)
    for text in TEXTS:
        protocol.data_received(Frame(Opcode.TEXT, text.encode()).serialize(mask=True))
    assert taken == TEXTS
    protocol.connection_lost(None)
    await turns()


async def test_who_was_heard_is_not_asked_whether_he_is_there():
    sent: list[bytes] = []

    async def application(scope: Any, receive: Any, send: Any) -> None:
        scope["extensions"][READ_NOW](partial(keep, []))
        await receive()
        await send({"type": "websocket.accept"})
        await receive()

    protocol = await shake_hands(application)
    vars(protocol.transport)["write"] = sent.append
    protocol.data_received(Frame(Opcode.TEXT, b"one").serialize(mask=True))
    protocol.send_keepalive_ping()
    assert sent == []
    assert protocol.ping_timer is not None  # but soon
    protocol.send_keepalive_ping()
    assert sent[0][0] & 0xF == Opcode.PING
    assert protocol.pong_timer is not None
    protocol.connection_lost(None)
    await turns()
