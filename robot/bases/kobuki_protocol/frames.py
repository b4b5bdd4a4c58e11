"""Frames: found in a stream of bytes, and made.

A frame is AA 55, the payload's length, the payload, and the XOR of length and payload; a payload is
a row of sub-payloads, each its id, its length and its data, little-endian
(docs/reference/kobuki.md#framing). Nothing is escaped: AA 55 may stand anywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import reduce
from operator import xor
from struct import Struct
from typing import Any, Generic, TypeVar

BAUD = 115200  # 8N1, no flow control (docs/reference/kobuki.md#serial-link)
FRAME_S = 0.02  # between two feedback frames (docs/reference/kobuki.md#feedback)

HEADER = b"\xaa\x55"
# Bytes of a payload: id, length and one byte of data (docs/reference/kobuki.md#framing).
SHORTEST = 3
# All that a base can send in one frame is 175 bytes (docs/reference/kobuki.md#feedback). A longer
# one is a false header, and waiting for its end would hold up the true frames behind it.
LONGEST = 192

T = TypeVar("T")


class Malformed(ValueError):
    """A payload that cannot be decoded, though its checksum may be right."""


def frame(payload: bytes) -> bytes:
    """Return the frame around a payload. Raises ValueError for one too short or too long."""
    if not SHORTEST <= len(payload) <= LONGEST:
        raise ValueError(f"A payload has {SHORTEST} to {LONGEST} bytes, not {len(payload)}.")
    body = bytes((len(payload),)) + payload
    return HEADER + body + bytes((reduce(xor, body),))


class FrameReader(Generic[T]):
    """Finds frames in a stream of bytes, however it is cut up and whatever else is in it.

    A frame that is not valid is searched for another one from its second byte on: the header may
    have been false, with a true one behind it (docs/reference/kobuki.md#lost-bytes).

    Parameters
    ----------
    decode
        Returns what a payload holds, or raises Malformed: ``decode_feedback``, ``decode_commands``.

    Attributes
    ----------
    frames
        How many frames were valid.
    bad_checksums, malformed
        How many were not, by cause.
    skipped_bytes
        How many bytes belong to no valid frame.
    """

    def __init__(self, decode: Callable[[bytes], T]) -> None:
        self.frames = self.bad_checksums = self.malformed = self.skipped_bytes = 0
        self._decode = decode
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[T]:
        """Add the next bytes, and return the contents of the frames that they complete.

        Parameters
        ----------
        data
            Any number of bytes, cut anywhere.
        """
        buffer, found, at = self._buffer, [], 0
        buffer += data
        while True:
            start = buffer.find(HEADER, at)
            if start < 0:
                start = len(buffer) - buffer.endswith(HEADER[:1], at)
            self.skipped_bytes += start - at
            at = start
            if len(buffer) < at + 3:
                break
            end = at + buffer[at + 2] + 4
            if SHORTEST <= end - at - 4 <= LONGEST:
                if len(buffer) < end:
                    break
                try:
                    found.append(self._open(bytes(buffer[at + 2 : end])))
                except Malformed:
                    pass
                else:
                    at = end
                    continue
            self.skipped_bytes += 1
            at += 1
        del buffer[:at]
        return found

    def _open(self, body: bytes) -> T:
        """Return what a frame holds, given from its length to its checksum. Raises Malformed."""
        if reduce(xor, body):
            self.bad_checksums += 1
            raise Malformed("The checksum is wrong.")
        try:
            content = self._decode(body[1:-1])
        except Malformed:
            self.malformed += 1
            raise
        self.frames += 1
        return content


def sub_payload(number: int, data: bytes) -> bytes:
    """Return a sub-payload: its id, its length and its data.

    Parameters
    ----------
    number
        Its id, 0 to 255.
    data
        At most 255 bytes.
    """
    return bytes((number, len(data))) + data


def split(payload: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield id and data of each sub-payload. Raises Malformed where they do not fill it exactly."""
    at, end = 0, len(payload)
    while at < end:
        if at + 2 > end or at + 2 + payload[at + 1] > end:
            raise Malformed("A sub-payload is longer than its frame.")
        begin = at + 2
        number, at = payload[at], begin + payload[at + 1]
        yield number, payload[begin:at]


def unpack(layout: Struct, number: int, data: bytes) -> tuple[Any, ...]:
    """Return the fields of a sub-payload.

    Parameters
    ----------
    layout
        Its fields, little-endian.
    number
        Its id, which the error names.
    data
        Its bytes.

    Raises
    ------
    Malformed
        Where its length is wrong.
    """
    if len(data) != layout.size:
        raise Malformed(f"Sub-payload {number} has {layout.size} bytes, not {len(data)}.")
    return layout.unpack(data)
