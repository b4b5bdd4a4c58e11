"""Whole text messages as websocket frames (RFC 6455, 5.2), past the layers of servers and ASGI.

Through daphne, autobahn and Twisted, or through uvicorn and websockets, a message passes layers
that look for what we never do: bytes, fragments, compression. Both servers take this way for what
is plain, and their own for all else (websockets.py, uvicorn_server.py).
"""

from __future__ import annotations

from websockets.frames import apply_mask  # type: ignore[attr-defined]  # in C where it can be

MAX_WAITING_BYTES = 256 * 1024  # received of a client, and not handled yet
MESSAGE_BYTES = 512  # what a message takes beside its text
TEXT = 0x81  # a whole message, not a part of one
MASKED = 0x80
# In a connection's scope ("extensions"): writes a text frame at once, or returns False.
WRITE_NOW = "garry.write_now"
# There too: takes a function that handles a text at once, or returns False; it then goes the usual
# way. Called only while no other message waits.
READ_NOW = "garry.read_now"


def text_frame(text: str) -> bytes:
    """Return a server's frame of a whole text message."""
    data = text.encode()
    size = len(data)
    if size < 126:
        return bytes((TEXT, size)) + data
    if size < 65536:
        return bytes((TEXT, 126)) + size.to_bytes(2) + data
    return bytes((TEXT, 127)) + size.to_bytes(8) + data


def read_text_frame(data: bytes) -> bytes | None:
    """Return the text of a client's frame where the bytes are one whole text message, else None."""
    if len(data) < 6 or data[0] != TEXT or not data[1] & MASKED:
        return None
    size, begin = data[1] & 0x7F, 6
    if size == 126:
        size, begin = int.from_bytes(data[2:4]), 8
        if size < 126:
            return None  # not the shortest way to write it: a fault
    elif size == 127:
        return None  # longer than any frame may be
    if not 0 < size == len(data) - begin:
        return None
    return apply_mask(data[begin:], data[begin - 4 : begin])


class FrameEdges:
    """Follows a stream of frames, to know whether its next byte begins one."""

    def __init__(self) -> None:
        self._head = bytearray()  # of a frame whose head is not whole yet
        self._left = 0  # bytes of the current frame's payload

    @property
    def is_between_frames(self) -> bool:
        """Whether all frames so far were whole."""
        return not (self._head or self._left)

    def pass_by(self, data: bytes) -> None:
        """Follow bytes of the stream."""
        position = 0
        while position < len(data):
            if self._left:
                passed = min(self._left, len(data) - position)
                self._left -= passed
                position += passed
                continue
            self._head.append(data[position])
            position += 1
            size = _payload_size(self._head)
            if size is not None:
                self._left = size
                self._head.clear()


def _payload_size(head: bytes | bytearray) -> int | None:
    """Return the size of a frame's payload, or None until its head is whole."""
    if len(head) < 2:
        return None
    size, begin = head[1] & 0x7F, 2
    if size > 125:
        begin += 2 if size == 126 else 8
        size = int.from_bytes(head[2:begin])
    return size if len(head) == begin + (4 if head[1] & MASKED else 0) else None
