"""The base of all sockets: who is connected, frames in and out, a clean close."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Awaitable, Coroutine
from typing import Any

from channels.exceptions import StopConsumer
from channels.generic.websocket import AsyncWebsocketConsumer
from django.db import DatabaseError

from rehab.people import clinic_limits
from rehab.people.token_buckets import TokenBucket
from rehab.sessions.events.event import to_text
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.auth import Actor
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored, describe_failure
from rehab.sessions.live.protocol.frames import READ_NOW, WRITE_NOW
from rehab.sessions.live.protocol.messages import read_frame
from rehab.sessions.live.protocol.outgoing import Outbox
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.log_fold import DamagedLog
from rehab.sessions.state_messages import Message
from robot.wire.close_codes import CloseCode
from robot.wire.frames import BadFrame

log = logging.getLogger(__name__)

FIRST_FRAME_S = 10.0
FRAMES_PER_S = 200.0
FRAME_BURST = 1000.0


def _cannot_write(_: str) -> bool:
    return False


class CloseSocket(Exception):
    """Closes a socket with a code, after an error message."""

    def __init__(self, code: int, error: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.error = error


class Socket(AsyncWebsocketConsumer):
    """A socket of the live path.

    It uses no channel layer (the hub is in this process) and, unlike Channels' own dispatch, hops
    to no database thread for each frame: half of what a step costs
    (docs/reference/stack.md#one-process). Subclasses implement the
    methods ``on_…``.
    """

    live: LiveSession | None = None
    actor: Actor = None  # once authenticated
    clinic_id: int | None = None  # once it is known
    first_frame_s = FIRST_FRAME_S

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Serve the socket until either side ends it."""
        self.scope = scope
        self.base_send: Any = send
        self.runtime = runtimes.current()
        self.is_closed = False
        self._is_receiving = False  # nothing is being handled
        self._write_now = scope.get("extensions", {}).get(WRITE_NOW, _cannot_write)
        if (read_now := scope.get("extensions", {}).get(READ_NOW)) is not None:
            read_now(self._take)
        self.outbox = Outbox(self.send, self.write)
        self._tasks: set[asyncio.Task[None]] = set()
        self._context = contextvars.copy_context()
        self._frames = TokenBucket(FRAME_BURST, 1 / FRAMES_PER_S)
        self.runtime.sockets.add(self)
        try:
            await self._serve(receive)
        except StopConsumer:
            pass
        finally:
            self.runtime.sockets.discard(self)
            if self.clinic_id is not None:
                self.runtime.sockets_of[self.clinic_id] -= 1
            self.is_closed = True
            for task in self._tasks:
                task.cancel()
            self.on_disconnect()

    def belong_to(self, clinic_id: int) -> None:
        """Note whose socket it is. Raises CloseSocket where the clinic has its share of them."""
        if self.runtime.sockets_of[clinic_id] >= clinic_limits.max_sockets():
            raise CloseSocket(CloseCode.TOO_MANY, "clinic_full", clinic_limits.CURE)
        self.runtime.sockets_of[clinic_id] += 1
        self.clinic_id = clinic_id

    async def _serve(self, receive: Any) -> None:
        while True:
            self._is_receiving = True
            try:
                message = await receive()
            finally:
                self._is_receiving = False
            match message["type"]:
                case "websocket.connect":
                    await self.accept()
                    if self.runtime.draining:
                        await self.close_now(CloseCode.RESTARTING)
                    else:
                        self.start(self.outbox.pump())
                        await self._guard(self.on_connect())
                case "websocket.receive":
                    if not self.is_closed:
                        await self._guard(self._on_frame(message))
                case "websocket.disconnect":
                    raise StopConsumer

    def _take(self, text: str) -> bool:
        """Handle a text at once, where it is its turn and nothing has to be waited for."""
        if not self._is_receiving or self.is_closed:
            return False
        if self._frames.wait_s(self.runtime.loop.time()):
            return False
        try:
            taken = self.handle_now(text)
        except (
            Exception
        ):  # whatever it was, the usual way meets it too, and reports it to the client
            return False
        if taken:
            self._count_frame()
        return taken

    def handle_now(self, text: str) -> bool:
        """Handle a frame that needs no waiting; return False for any other."""
        return False

    async def _on_frame(self, message: dict[str, Any]) -> None:
        self._count_frame()
        await self.on_frame(message.get("text"))

    def _count_frame(self) -> None:
        """Count a frame. Raises CloseSocket if they come faster than any real client sends."""
        if self._frames.take(self.runtime.loop.time()):
            raise CloseSocket(
                CloseCode.TOO_MANY, "flood", f"Send at most {FRAMES_PER_S:g} frames a second."
            )

    async def _guard(self, work: Awaitable[None]) -> None:
        """Await the work; send its error to the client, so that no other is affected."""
        try:
            await work
        except BadFrame as problem:
            await self.close_with_error(CloseCode.NOT_PROTOCOL, problem.code, str(problem))
        except CloseSocket as problem:
            await self.close_with_error(problem.code, problem.error, str(problem))
        except runtimes.Draining:
            await self.close_now(CloseCode.RESTARTING)
        except OwnedElsewhere as problem:
            more = {"server": problem.server} if problem.server else {}
            await self.close_with_error(CloseCode.ELSEWHERE, "elsewhere", str(problem), **more)
        except DamagedLog as problem:
            await self.close_with_error(CloseCode.NO_SESSION, "damaged_log", str(problem))
        except NotStored as problem:
            await self.close_with_error(CloseCode.NOT_STORED, "not_stored", str(problem))
        except DatabaseError as problem:
            log.exception("A socket could not read or write the database")
            await self.close_with_error(
                CloseCode.NOT_STORED, "not_stored", describe_failure(problem)
            )
        except Exception:
            log.exception("A socket failed")
            await self.close_with_error(
                CloseCode.NOT_STORED, "server_error", "The server failed. Connect again."
            )

    def start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run a task that lives as long as the socket."""
        return self._run(work, self._tasks)

    def run_to_end(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a task to its end, even if the socket closes meanwhile."""
        self._run(work, self.runtime.requests)

    def _run(
        self, work: Coroutine[Any, Any, None], among: set[asyncio.Task[None]]
    ) -> asyncio.Task[None]:
        # The socket's own context, without asgiref's thread state of a page that caused this.
        task = self.runtime.loop.create_task(self._guard(work), context=self._context)
        among.add(task)
        task.add_done_callback(among.discard)
        task.add_done_callback(lambda _: work.close())  # for one cancelled before it began
        return task

    async def send(  # type: ignore[override]
        self, text_data: str | None = None, bytes_data: bytes | None = None, close: bool = False
    ) -> None:
        """Send a text frame, unless the socket is closed."""
        if not self.is_closed and text_data is not None:
            await self._send_raw({"type": "websocket.send", "text": text_data})

    def write(self, text: str) -> bool:
        """Write a text frame now; return False where it has to wait its turn (``send``)."""
        return self.is_closed or self._write_now(text)

    async def send_message(self, message: Message) -> None:
        """Send a message now."""
        await self.send(to_text(message))

    async def close_with_error(self, code: int, error: str, message: str, **more: str) -> None:
        """Send an error and close."""
        await self.send_message({"type": "error", "code": error, "message": message, **more})
        await self.close_now(code)

    def revoke(self) -> None:
        """Close a socket that is no longer authorized."""
        self.start(
            self.close_with_error(
                CloseCode.UNAUTHORIZED, "revoked", "The token or sign-in is no longer valid."
            )
        )

    async def close_now(self, code: int) -> None:
        """Close with a code."""
        if not self.is_closed:
            # autobahn, below daphne, takes no subclass of int
            await self._send_raw({"type": "websocket.close", "code": int(code)})
            self.is_closed = True

    async def _send_raw(self, message: dict[str, Any]) -> None:
        try:
            await self.base_send(message)
        except Exception as problem:  # each server has its own exception for a client that is gone
            log.debug("A client was gone: %s", problem)
            self.is_closed = True

    def close_soon(self, code: int) -> None:
        """Close soon; for callers that cannot await."""
        self.start(self.close_now(code))

    async def enforce_first_frame(self) -> None:
        """Close a socket without a first frame in time. Cancelled by a valid one."""
        await asyncio.sleep(self.first_frame_s)
        raise CloseSocket(
            CloseCode.NOT_PROTOCOL, "silent", f"Send hello within {self.first_frame_s:g} s."
        )

    async def on_connect(self) -> None:
        """Handle a new connection."""

    async def on_frame(self, text: str | None) -> None:
        """Handle a frame."""
        read_frame(text)

    def on_disconnect(self) -> None:
        """Release what the socket holds."""


class NotFoundConsumer(Socket):
    """Answers at addresses without a socket."""

    async def on_connect(self) -> None:
        """Close with an error."""
        raise CloseSocket(
            CloseCode.NO_SESSION, "no_address", "No socket has this address; see /help/protocol/."
        )
