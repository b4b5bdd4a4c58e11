"""What a server refuses a client with, and the cures."""

from __future__ import annotations

from robot.wire.close_codes import CloseCode

# Close code: the cure, for a server that does not name one. Connecting again unchanged would not
# help; after 4009 it would close the newer socket, which would dial in again, and so on.
REFUSALS: dict[int, str] = {
    CloseCode.UNAUTHORIZED: (
        "The token is missing, wrong or revoked. Make a new one for this device in the admin."
    ),
    CloseCode.NO_SESSION: (
        "There is no such session for this device. Check the address and the station."
    ),
    CloseCode.REPLACED: (
        "Another program dialed in with the same token. Stop one of them, or give each its own "
        "device."
    ),
    CloseCode.NOT_PROTOCOL: (
        "The server does not understand this client. Use the version that fits the server."
    ),
    CloseCode.BUSY: "The session has another source or robot. Stop that one first.",
    CloseCode.ENDED: "The session has ended.",
}
# After these the pause is not reset to the shortest: the server, or what we send, is at fault, and
# a quick reconnection would make it worse.
TROUBLE = frozenset({CloseCode.NOT_STORED, CloseCode.TOO_MANY, 1002, 1003, 1007, 1009})

# Handshakes that are refused by a status instead of a close code.
STATUS_CODES = {
    401: CloseCode.UNAUTHORIZED,
    403: CloseCode.UNAUTHORIZED,
    404: CloseCode.NO_SESSION,
}
PASSING_STATUSES = frozenset({408, 425, 429})


class LinkRefused(Exception):
    """The server refuses this client; the message says what to do.

    ``code`` is a close code of docs/protocol.md.
    """

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code
