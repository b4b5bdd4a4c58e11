"""Texts at daphne, handled as they come or queued: each once, in order, however TCP cuts them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from daphne.ws_protocol import WebSocketFactory
from twisted.internet.task import Clock
from twisted.internet.testing import StringTransport
from websockets.frames import Frame, Opcode

from rehab.sessions.live.websockets import DirectProtocol

HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
TEXTS = ["one", "é" * 100, "three", "4", "five"]


class Transport(StringTransport):
    """One that sends all at once."""

    connected, dataBuffer, _tempDataLen = True, b"", 0  # noqa: N815

    def writeSomeData(self, data: bytes) -> int:  # noqa: N802
        """Send bytes; return how many the kernel took."""
        self.write(data)
        return len(data)


class FakeDaphne:
    """What a protocol needs of daphne's server: an application that keeps what it is sent."""

    proxy_forwarded_address_header = None
    root_path = ""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()

    def create_application(self, *_: Any) -> asyncio.Queue[dict[str, Any]]:
        """Return what a connection's messages are put into."""
        return self.queue

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None

    def texts(self) -> list[str]:
        """Return the texts that were queued, which are then handled."""
        messages = [self.queue.get_nowait() for _ in range(self.queue.qsize())]
        return [one["text"] for one in messages if "text" in one]


def connect(take: Callable[[str], bool]) -> tuple[DirectProtocol, FakeDaphne]:
    """Return the server's side of an open connection."""
    daphne = FakeDaphne()
    factory = WebSocketFactory(daphne, reactor=Clock())
    protocol = factory.buildProtocol(None)
    vars(protocol)["_raw_query_string"] = b""  # as daphne's HTTP side passes it on
    protocol.makeConnection(Transport())
    protocol.dataReceived(HANDSHAKE)
    protocol.handle_reply({"type": "websocket.accept"})
    assert protocol.state == protocol.STATE_OPEN
    assert daphne.texts() == []
    protocol.read_now(take)
    return protocol, daphne


def keep(texts: list[str]) -> Callable[[str], bool]:
    """Return a function that takes each text."""

    def take(text: str) -> bool:
        texts.append(text)
        return True

    return take


def stream() -> bytes:
    """Return the texts as a client's frames: a ping among them, the last one in two parts."""
    frames = [Frame(Opcode.TEXT, text.encode()) for text in TEXTS[:-1]]
    frames.insert(2, Frame(Opcode.PING, b"there?"))
    frames += [Frame(Opcode.TEXT, b"fi", fin=False), Frame(Opcode.CONT, b"ve")]
    return b"".join(frame.serialize(mask=True) for frame in frames)


@pytest.mark.parametrize("taken_chars", [[], [1, 3, 5, 100], [3, 5]], ids=["none", "all", "some"])
@pytest.mark.parametrize("is_quick", [True, False])
def test_texts_come_once_and_in_order(taken_chars, is_quick):
    """``is_quick``: the application has handled what is queued before more comes."""
    for size in (*range(1, 40), 10_000):
        got: list[str] = []

        def take(text: str, got: list[str] = got) -> bool:
            if len(text) in taken_chars:
                got.append(text)
            return len(text) in taken_chars

        protocol, daphne = connect(take)
        data = stream()
        for begin in range(0, len(data), size):
            protocol.dataReceived(data[begin : begin + size])
            if is_quick:
                got += daphne.texts()
        got += daphne.texts()
        assert got == TEXTS


def test_a_frame_inside_a_texts_bytes_is_no_message():
    """Whoever chooses the mask chooses the bytes: here a part of a text looks like a whole one."""
    mask = b"\x80" * 4
    inner = bytes((0x81, 0x85)) + mask + bytes(0x80 | byte for byte in b"inner")
    text = bytes(byte ^ 0x80 for byte in b"\xe1" + inner + b"\xe2")
    pieces = [bytes((0x81, 0x80 | len(text))) + mask + b"\xe1", inner, b"\xe2"]
    taken: list[str] = []
    protocol, daphne = connect(keep(taken))
    for piece in pieces:
        protocol.dataReceived(piece)
    assert taken + daphne.texts() == [text.decode()]


def test_whole_texts_are_taken_past_the_queue():
    taken: list[str] = []
    protocol, daphne = connect(keep(taken))
    for text in TEXTS:
        protocol.dataReceived(Frame(Opcode.TEXT, text.encode()).serialize(mask=True))
    assert (taken, daphne.texts()) == (TEXTS, [])
