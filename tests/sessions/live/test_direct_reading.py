"""Texts at daphne, handled as they come or queued: each once, in order, however TCP cuts them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from autobahn.websocket.protocol import WebSocketProtocol as AutobahnProtocol
from daphne.ws_protocol import WebSocketFactory
from daphne.ws_protocol import WebSocketProtocol as DaphneProtocol
from hypothesis import given
from hypothesis import strategies as st
from twisted.internet.task import Clock
from twisted.internet.testing import StringTransport
from websockets.frames import Frame, Opcode

from rehab.sessions.live.protocol.frames import read_text_frame, text_frame
from rehab.sessions.live.websockets import DirectProtocol

HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
TEXTS = ["one", "é" * 100, "three", "4", "five"]


class Transport(StringTransport):
    """One that sends all at once."""

    connected, dataBuffer, _tempDataLen = True, b"", 0  # noqa: N815
    direct = 0  # how often bytes went past those that wait

    def writeSomeData(self, data: bytes) -> int:  # noqa: N802
        """Send bytes; return how many the kernel took."""
        self.write(data)
        self.direct += 1
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


def test_who_sends_a_text_need_not_answer_a_ping():
    protocol, _ = connect(keep([]))
    protocol.autoPingTimeout = 30
    protocol._sendAutoPing()
    assert protocol.autoPingTimeoutCall
    protocol.dataReceived(Frame(Opcode.TEXT, b"here").serialize(mask=True))
    assert not protocol.autoPingTimeoutCall


@pytest.mark.parametrize("waiting", [b"", b"earlier"])
def test_nothing_overtakes_what_the_kernel_has_not_taken(waiting):
    protocol, _ = connect(keep([]))
    protocol.transport.dataBuffer, protocol.transport.direct = waiting, 0
    sent = protocol.transport.value()
    protocol.sendData(b"now")
    assert protocol.transport.value() == sent + b"now"
    assert protocol.transport.direct == (0 if waiting else 1)


# --- frames ---------------------------------------------------------------------------------------

SIZES = [1, 125, 126, 127, 65_535]


def a_frame(opcode: Opcode, data: bytes, *, fin: bool = True, masked: bool = True) -> bytes:
    return Frame(opcode, data, fin).serialize(mask=masked)


@pytest.mark.parametrize("size", SIZES)
def test_a_whole_text_is_read(size):
    data = bytes(index % 251 for index in range(size))
    assert read_text_frame(a_frame(Opcode.TEXT, data)) == data


@given(st.binary(min_size=1, max_size=300), st.integers(min_value=1))
def test_no_part_of_a_frame_is_taken_for_one(data, cut):
    whole = a_frame(Opcode.TEXT, data)
    assert read_text_frame(whole) == data
    assert read_text_frame(whole[: cut % len(whole)]) is None
    assert read_text_frame(whole + whole[: 1 + cut % len(whole)]) is None


@pytest.mark.parametrize(
    "data",
    [
        b"",
        a_frame(Opcode.TEXT, b""),
        a_frame(Opcode.TEXT, b"x", fin=False),
        a_frame(Opcode.CONT, b"x"),
        a_frame(Opcode.BINARY, b"x"),
        a_frame(Opcode.PING, b"x"),
        a_frame(Opcode.PONG, b"x"),
        a_frame(Opcode.TEXT, b"x" * 20, masked=False),
        a_frame(Opcode.TEXT, b"x" * 65_536),
        b"\x81\xfe\x00\x01" + b"mask" + b"x",  # a length that is not written in the shortest way
        b"\xc1" + a_frame(Opcode.TEXT, b"x")[1:],  # compressed
    ],
    ids=range(11),  # masks are random
)
def test_all_else_is_left_to_the_server(data):
    assert read_text_frame(data) is None


def test_daphne_and_autobahn_still_have_what_is_overridden():
    """A name that is gone there would never be called here."""
    assert {"_dataReceived", "sendData", "_cancelAutoPingTimeoutCall"} <= vars(
        AutobahnProtocol
    ).keys()
    assert "onMessage" in vars(DaphneProtocol)


def test_a_text_of_any_letters_is_whole():
    assert text_frame("é") == b"\x81\x02\xc3\xa9"
