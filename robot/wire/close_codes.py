"""Close codes of the websockets: the table of docs/protocol.md."""

from __future__ import annotations

from enum import IntEnum


class CloseCode(IntEnum):
    """Why the server closes a socket. 4000 to 4999 are free for applications (RFC 6455, 7.4.2)."""

    UNAUTHORIZED = 4001
    NO_SESSION = 4004
    UNCONFIRMED = 4008
    REPLACED = 4009
    NOT_STORED = 4011
    RESTARTING = 4012
    TOO_MANY = 4029
    NOT_PROTOCOL = 4400
    BUSY = 4409
    ENDED = 4410
    ELSEWHERE = 4421


# After these a page does not connect again by itself.
FINAL_FOR_PAGES = frozenset(
    {
        CloseCode.UNAUTHORIZED,
        CloseCode.NO_SESSION,
        CloseCode.REPLACED,
        CloseCode.NOT_PROTOCOL,
        CloseCode.ENDED,
    }
)
