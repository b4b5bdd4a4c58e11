"""Websockets under daphne: what is overridden of it, autobahn and Twisted, and why.

Each override has a test that fails when a new version below changes what it rests on
(tests/sessions/live/test_websockets.py).
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

from autobahn.twisted import websocket as twisted_websocket
from autobahn.websocket import protocol as websocket_protocol
from daphne.ws_protocol import WebSocketFactory, WebSocketProtocol
from twisted.protocols.tls import TLSMemoryBIOProtocol

from rehab.sessions.live.protocol.frames import (
    MAX_WAITING_BYTES,
    MESSAGE_BYTES,
    read_text_frame,
    text_frame,
)


def _plain(*_: object, **__: object) -> str:
    return ""


# Autobahn formats a colored debug line for each frame even if none is logged: a tenth of the event
# loop's time in a profile of 700 sessions.
for module in (websocket_protocol, twisted_websocket):
    vars(module).update(hltype=_plain, hlval=_plain)


class InboundQueue(asyncio.Queue[dict[str, Any]]):
    """The messages of one client that wait for the application, limited in bytes.

    Daphne reads on without a limit: a client that is still being authenticated could fill the
    memory. Here reading pauses, and TCP makes the client wait.
    """

    def __init__(self, transport: Any) -> None:
        super().__init__()
        self.waiting_bytes = 0
        self._transport = transport
        self._is_paused = False

    def _put(self, item: dict[str, Any]) -> None:
        super()._put(item)
        self.waiting_bytes += _size(item)
        if self.waiting_bytes > MAX_WAITING_BYTES and not self._is_paused:
            self._is_paused = True
            self._transport.pauseProducing()

    def _get(self) -> dict[str, Any]:
        item = super()._get()
        self.waiting_bytes -= _size(item)
        if self._is_paused and self.waiting_bytes <= MAX_WAITING_BYTES // 2:
            self._is_paused = False
            self._transport.resumeProducing()
        return item


def _size(message: dict[str, Any]) -> int:
    return MESSAGE_BYTES + len(message.get("text") or message.get("bytes") or "")


class DirectProtocol(WebSocketProtocol):  # type: ignore[misc]
    """Reads and writes text frames past the layers between the transport and the application.

    Twisted would also write on the next turn of its loop only.
    """

    _take: Callable[[str], bool] | None = None

    def read_now(self, take: Callable[[str], bool]) -> None:
        """Let a function handle texts at once; what it does not is queued for the application."""
        self._take = take

    def send_text(self, text: str) -> bool:
        """Send a text message, unless the socket is not open. Return True: nothing waits."""
        if self.state == self.STATE_OPEN and not self.muted:
            self.sendData(text_frame(text))
        return True

    def _dataReceived(self, data: bytes) -> None:  # noqa: N802
        """Take bytes from the transport: a whole text message at once, all else as usual."""
        text = None
        if self.state == self.STATE_OPEN and not self.data and self._is_between_messages:
            text = read_text_frame(data)
        decoded = None if text is None else _decode(text)
        if text is None or decoded is None:
            super()._dataReceived(data)
            return
        if self.autoPingTimeoutCall and self.autoPingRestartOnAnyTraffic:
            self._cancelAutoPingTimeoutCall()
        free = self._take is not None and not self.muted and self.application_queue.empty()
        if free and self._take is not None and self._take(decoded):
            self.last_ping = time.time()  # as ``onMessage`` notes that the client is there
        else:
            self.onMessage(text, False)

    @property
    def _is_between_messages(self) -> bool:
        return self.current_frame is None and not self.inside_message

    def sendData(self, data: bytes, sync: bool = False, chopsize: int | None = None) -> None:  # noqa: N802
        """Send bytes; what the kernel does not accept now takes the usual way."""
        out = self.transport
        # Encrypted, the bytes of the connection below are not ours to write.
        idle = not (sync or chopsize or self.send_queue or isinstance(out, TLSMemoryBIOProtocol))
        idle = idle and not (out.dataBuffer or out._tempDataLen)  # noqa: SLF001
        if idle and out.connected and not out.disconnecting:
            sent = out.writeSomeData(data)
            if isinstance(sent, int) and sent > 0:
                data = data[sent:]
        if data:
            super().sendData(data, sync, chopsize)


def _decode(data: bytes) -> str | None:
    """Return a text, or None for what is none: autobahn closes the socket for that."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return None


WebSocketFactory.protocol = DirectProtocol


def sender(
    protocol: Any, reply: Callable[[Any, dict[str, Any]], Awaitable[None]]
) -> Callable[[dict[str, Any]], Awaitable[None]]:
    """Return the ``send`` of an application: texts go out directly, all else by daphne's reply."""

    async def send(message: dict[str, Any]) -> None:
        if message["type"] == "websocket.send" and (text := message.get("text")) is not None:
            protocol.send_text(text)
        else:
            await reply(protocol, message)

    return send
