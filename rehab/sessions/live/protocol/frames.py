"""Whole text messages as websocket frames (RFC 6455, 5.2), past the layers of daphne and ASGI.

Through daphne, autobahn and Twisted a message passes layers that look for what our clients never
send: bytes, fragments, compression. A plain text takes this way, all else the usual one
(websockets.py).
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
