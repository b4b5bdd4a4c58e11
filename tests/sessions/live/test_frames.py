"""Text frames past the server's layers: whole, in every length, and nothing else taken for one."""

from __future__ import annotations

import pytest
from autobahn.websocket.protocol import WebSocketProtocol as AutobahnProtocol
from daphne.ws_protocol import WebSocketProtocol as DaphneProtocol
from hypothesis import given
from hypothesis import strategies as st
from websockets.frames import Frame, Opcode

from rehab.sessions.live.protocol.frames import read_text_frame, text_frame

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
