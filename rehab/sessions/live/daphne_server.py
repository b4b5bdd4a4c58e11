"""Daphne with the live path: recovery at the start, a clean drain at the end.

Importing this module installs Twisted's asyncio reactor, so only the commands that serve do it.
"""

from __future__ import annotations

import asyncio
import faulthandler
import logging
from collections.abc import Callable
from typing import Any

from daphne import http_protocol
from daphne.server import Server
from django.conf import settings
from twisted.internet import defer, reactor
from twisted.protocols.tls import TLSMemoryBIOProtocol

from rehab.sessions.live import process
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database import server_lease
from rehab.sessions.live.https_port import encrypt
from rehab.sessions.live.process import end_tasks
from rehab.sessions.live.protocol.frames import READ_NOW, WRITE_NOW
from rehab.sessions.live.pulse import keep_pulse
from rehab.sessions.live.websockets import DirectProtocol, InboundQueue, sender
from robot.wire.limits import MAX_FRAME_BYTES

log = logging.getLogger(__name__)

CLOSE_S = 2.0  # how long clients have to answer our close frame


class BoundedRequest(http_protocol.WebRequest):  # type: ignore[misc]
    """Closes the connection of a request whose body is longer than any page accepts.

    Twisted would write all of it to the disk before Django could refuse it. It would also read a
    form that Django reads again.
    """

    too_long = False

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, parsePOSTFormSubmission=False, **options)

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
        self._tasks: list[asyncio.Task[None]] = []

    def run(self) -> None:
        """Serve until stopped."""
        reactor.callWhenRunning(self._begin)
        super().run()

    def create_application(self, protocol: Any, scope: dict[str, Any]) -> Any:
        """Start the application of a connection; return the queue of what it receives."""
        if not isinstance(protocol, DirectProtocol):
            return super().create_application(protocol, scope)
        if isinstance(protocol.transport, TLSMemoryBIOProtocol):
            scope["scheme"] = "wss"  # daphne leaves it out
        queue = InboundQueue(protocol.transport)
        scope.setdefault("asgi", {"version": "3.0"})
        scope["extensions"] = {WRITE_NOW: protocol.send_text, READ_NOW: protocol.read_now}
        application = self.application(
            scope=scope, receive=queue.get, send=sender(protocol, self.handle_reply)
        )
        if protocol not in self.connections:
            application.close()
            return None
        self.connections[protocol]["application_instance"] = asyncio.ensure_future(application)
        return queue

    def _begin(self) -> None:
        # The reactor runs before its event loop does.
        loop = asyncio.get_event_loop()
        loop.call_soon(lambda: self._run_tasks(loop))

    def _run_tasks(self, loop: asyncio.AbstractEventLoop) -> None:
        faulthandler.enable()  # a supervisor ends a server that hangs by SIGABRT
        own = server_lease.held()
        pulse = loop.create_task(keep_pulse(None if own is None else own.show_pulse))
        self._hold(pulse)  # it goes on while the server drains
        self._hold(loop.create_task(self._start()))

    def _hold(self, task: asyncio.Task[None]) -> None:
        self._tasks.append(task)  # those without a reference may be collected

    async def _start(self) -> None:
        process.tune_interpreter()
        paused = await runtimes.current().recover()
        if paused:
            log.warning("%s session(s) were left running; they are paused now.", paused)
        if not settings.HOSTED:
            has_begun = asyncio.Event()
            self._hold(asyncio.create_task(encrypt(self.http_factory, has_begun)))
            await has_begun.wait()
        if self._on_ready is not None:
            self._on_ready()

    def kill_all_applications(self) -> defer.Deferred[Any]:
        """Drain before the reactor stops: close sockets, commit, end the writer."""
        process.end_in_time()
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
        open_tasks = [task for task in (*tasks, *self._tasks) if task and not task.done()]
        await end_tasks(open_tasks)

    async def _until_closed(self) -> None:
        """Wait until the sockets are closed: stopping with an open one can crash.

        Source: docs/reference/stack.md#ending.
        """
        deadline = asyncio.get_running_loop().time() + CLOSE_S
        while asyncio.get_running_loop().time() < deadline:
            if all("disconnected" in details for details in self.connections.values()):
                return
            await asyncio.sleep(0.02)
