"""Daphne with the live path: recovery at the start, a clean drain at the end.

Importing this module installs Twisted's asyncio reactor, so only the commands that serve do it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any

from autobahn.twisted import websocket as twisted_websocket
from autobahn.websocket import protocol as websocket_protocol
from daphne import http_protocol
from daphne.server import Server
from daphne.ws_protocol import WebSocketFactory, WebSocketProtocol
from django.conf import settings
from twisted.internet import defer, reactor

from rehab.sessions.live import runtime as runtimes
from robot.wire.limits import MAX_FRAME_BYTES

log = logging.getLogger(__name__)

CLOSE_S = 2.0  # how long clients have to answer our close frame


def _plain(*_: object, **__: object) -> str:
    return ""


# Autobahn formats a colored debug line for each frame even if none is logged: a tenth of the event
# loop's time in a profile of 700 sessions.
for module in (websocket_protocol, twisted_websocket):
    vars(module).update(hltype=_plain, hlval=_plain)


class EagerProtocol(WebSocketProtocol):  # type: ignore[misc]
    """Writes frames to the kernel at once.

    Twisted would ask its event loop to do so on the next turn. At 1,000 sessions on a full core
    that halved the median delay (383 → 164 ms, one run each), at the same processor time.
    """

    def sendData(self, data: bytes, sync: bool = False, chopsize: int | None = None) -> None:  # noqa: N802
        """Send bytes; what the kernel does not accept now takes the usual way."""
        out = self.transport
        idle = not (sync or chopsize or self.send_queue or out.dataBuffer or out._tempDataLen)  # noqa: SLF001
        if idle and out.connected and not out.disconnecting:
            sent = out.writeSomeData(data)
            if isinstance(sent, int) and sent > 0:
                data = data[sent:]
        if data:
            super().sendData(data, sync, chopsize)


WebSocketFactory.protocol = EagerProtocol


class BoundedRequest(http_protocol.WebRequest):  # type: ignore[misc]
    """Closes the connection of a request whose body is longer than any page accepts.

    Twisted would write all of it to the disk before Django could refuse it.
    """

    too_long = False

    def handleContentChunk(self, data: bytes) -> None:  # noqa: N802
        """Receive a part of the body."""
        if self.too_long:
            return
        if self.content.tell() + len(data) > settings.DATA_UPLOAD_MAX_MEMORY_SIZE:
            self.too_long = True
            self.channel.transport.write(b"HTTP/1.1 413 Content Too Large\r\n\r\n")
            self.channel.loseConnection()
            return
        super().handleContentChunk(data)

    def process(self) -> None:
        """Answer the request, unless its body was too long."""
        if not self.too_long:
            super().process()


http_protocol.WebRequest = BoundedRequest


class LiveServer(Server):  # type: ignore[misc]
    """One process with pages, sockets and all live sessions."""

    def __init__(self, *args: Any, on_ready: Callable[[], None] | None = None, **options: Any):
        options |= {
            "websocket_max_message_size": MAX_FRAME_BYTES + 1024,
            "websocket_max_frame_size": MAX_FRAME_BYTES + 1024,
            # A half-open socket is noticed within 20 s.
            "ping_interval": 10,
            "ping_timeout": 10,
        }
        super().__init__(*args, **options)
        self._on_ready = on_ready

    def run(self) -> None:
        """Serve until stopped."""
        reactor.callWhenRunning(self._begin)
        super().run()

    def _begin(self) -> None:
        # The reactor runs before its event loop does.
        loop = asyncio.get_event_loop()
        loop.call_soon(lambda: self._keep(loop.create_task(self._start())))

    def _keep(self, task: asyncio.Task[None]) -> None:
        self._starting = task  # tasks without a reference may be collected

    async def _start(self) -> None:
        paused = await runtimes.current().recover()
        if paused:
            log.warning("%s session(s) were left running; they are paused now.", paused)
        runtimes.tune_interpreter()
        if self._on_ready is not None:
            self._on_ready()

    def kill_all_applications(self) -> defer.Deferred[Any]:
        """Drain before the reactor stops: close sockets, commit, end the writer."""
        return defer.Deferred.fromFuture(asyncio.ensure_future(self._drain()))

    async def _drain(self) -> None:
        try:
            runtime = runtimes.peek()
            if runtime is not None:
                await runtime.drain()
            await self._until_closed()
        except Exception:
            log.exception("The server did not drain cleanly")
        tasks = [details.get("application_instance") for details in self.connections.values()]
        open_tasks = [task for task in tasks if task is not None and not task.done()]
        for task in open_tasks:
            task.cancel()
        await asyncio.gather(*open_tasks, return_exceptions=True)

    async def _until_closed(self) -> None:
        """Wait until the sockets are closed: stopping with an open one can crash.

        Source: docs/reference/stack.md#ending.
        """
        deadline = asyncio.get_running_loop().time() + CLOSE_S
        while asyncio.get_running_loop().time() < deadline:
            if all("disconnected" in details for details in self.connections.values()):
                return
            await asyncio.sleep(0.02)
