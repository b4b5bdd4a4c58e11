"""uvicorn with the live path: recovery at the start, a clean drain at the end."""

from __future__ import annotations

import contextlib
import logging
import signal
from collections.abc import Callable, Iterator
from typing import Any

from django.conf import settings
from django.core.exceptions import RequestAborted
from uvicorn import Config, Server
from uvicorn._types import ASGIReceiveEvent
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import HANDLED_SIGNALS
from websockets.protocol import OPEN

from rehab.sessions.live import process
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.protocol.frames import (
    MAX_WAITING_BYTES,
    MESSAGE_BYTES,
    READ_NOW,
    WRITE_NOW,
    FrameEdges,
    read_text_frame,
    text_frame,
)
from robot.wire.limits import MAX_FRAME_BYTES

log = logging.getLogger(__name__)

PING_S = 6.0  # a half-open socket is noticed within three times this
CLOSE_S = 5  # how long requests under way have to end


class BoundedBody:
    """Refuses a request whose body is longer than any page accepts, before all of it has come."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on."""
        size = 0

        async def receive_bounded() -> Any:
            nonlocal size
            message = await receive()
            size += len(message.get("body", b""))
            if size > settings.DATA_UPLOAD_MAX_MEMORY_SIZE:
                raise RequestAborted  # Django then answers nothing
            return message

        if scope["type"] != "http":
            await self._inner(scope, receive, send)
            return
        await self._inner(scope, receive_bounded, send)
        if size > settings.DATA_UPLOAD_MAX_MEMORY_SIZE:
            headers = [(b"connection", b"close")]
            await send({"type": "http.response.start", "status": 413, "headers": headers})
            await send({"type": "http.response.body"})


class DirectProtocol(WebSocketsSansIOProtocol):
    """Reads and writes text frames past the layers between the transport and the application.

    Reading pauses once much waits for the application, not with each message: that takes two calls
    of the system. A client that was just heard is not asked whether it is there.
    """

    _take: Callable[[str], bool] | None = None

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.waiting_bytes = 0
        self._edges = FrameEdges()
        self._was_heard = False  # since its last ping was due

    def read_now(self, take: Callable[[str], bool]) -> None:
        """Let a function handle texts at once; what it does not is queued for the application."""
        self._take = take

    def data_received(self, data: bytes) -> None:
        """Take bytes from the transport: a whole text message at once, all else as usual."""
        self._was_heard = True
        if self.conn.state is not OPEN or not self._take_text(data):
            if self.conn.state is OPEN:
                self._edges.pass_by(data)
            super().data_received(data)

    def _take_text(self, data: bytes) -> bool:
        between = self._edges.is_between_frames and self.conn.current_size is None
        if self._take is None or self.close_sent or not (between and self.queue.empty()):
            return False
        text = read_text_frame(data)
        try:
            return text is not None and self._take(text.decode())
        except UnicodeDecodeError:  # websockets closes the socket for that
            return False

    def send_keepalive_ping(self) -> None:
        """Ask whether the client is there, unless it was heard."""
        was_heard, self._was_heard = self._was_heard, False
        if was_heard:
            self.schedule_ping()
        else:
            super().send_keepalive_ping()

    def write_now(self, text: str) -> bool:
        """Send a text message; return False where the client is behind and it has to wait."""
        if not self.writable.is_set():
            return False
        if self.handshake_complete and not (self.close_sent or self.transport.is_closing()):
            self.transport.write(text_frame(text))
        return True

    def send_receive_event_to_app(self) -> None:
        """Queue a message for the application."""
        self.waiting_bytes += MESSAGE_BYTES + sum(map(len, self.frames))
        was_paused = self.read_paused
        self.read_paused = was_paused or self.waiting_bytes <= MAX_WAITING_BYTES
        super().send_receive_event_to_app()  # which pauses reading unless that is so already
        self.read_paused = was_paused or self.waiting_bytes > MAX_WAITING_BYTES

    async def receive(self) -> ASGIReceiveEvent:
        """Return the next message; read on once all are handled."""
        message = await super().receive()
        if self.queue.empty():
            self.waiting_bytes = 0
        return message

    async def run_asgi(self) -> None:
        """Run the application, which may write text frames at once."""
        ours: dict[str, Any] = {WRITE_NOW: self.write_now, READ_NOW: self.read_now}
        self.scope["extensions"].update(ours)
        await super().run_asgi()


class UvicornLiveServer(Server):
    """One process with pages, sockets and all live sessions, served by uvicorn."""

    def __init__(
        self, application: Any, host: str, port: int, on_ready: Callable[[], None] | None = None
    ) -> None:
        super().__init__(
            Config(
                BoundedBody(application),
                host=host,
                port=port,
                lifespan="off",
                proxy_headers=False,  # which of them to believe is decided in people.networks
                server_header=False,
                access_log=False,
                log_config=None,
                ws=DirectProtocol,
                ws_max_size=MAX_FRAME_BYTES + 1024,
                ws_ping_interval=PING_S,
                ws_ping_timeout=PING_S,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=CLOSE_S,
            )
        )
        self._on_ready = on_ready

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Stop on a signal; unlike uvicorn, end with status 0 after a clean drain."""
        before = {number: signal.signal(number, self.handle_exit) for number in HANDLED_SIGNALS}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    async def startup(self, *args: Any, **options: Any) -> None:
        """Recover the sessions of dead processes, then listen."""
        process.tune_interpreter()
        paused = await runtimes.current().recover()
        if paused:
            log.warning("%s session(s) were left running; they are paused now.", paused)
        await super().startup(*args, **options)
        if self._on_ready is not None:
            self._on_ready()

    async def shutdown(self, *args: Any, **options: Any) -> None:
        """Drain before the loop ends: close sockets, commit, end the writer."""
        process.end_in_time()
        for listener in self.servers:
            listener.close()
        try:
            await runtimes.current().drain()
        except Exception:
            log.exception("The server did not drain cleanly")
        await super().shutdown(*args, **options)
