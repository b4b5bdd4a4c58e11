"""The link itself: one connection at a time, its messages, and why it ended."""

from __future__ import annotations

import asyncio
import json
import random
import re
import ssl
from collections.abc import Awaitable, Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException

from robot.link.dialing import TIMING, BackOff, Timing, dial
from robot.link.refusals import (
    PASSING_STATUSES,
    REFUSALS,
    STATUS_CODES,
    TROUBLE,
    LinkRefused,
)
from robot.wire.close_codes import CloseCode
from robot.wire.limits import MAX_FRAME_BYTES

Message = dict[str, Any]

# Tells a proxy which of several servers to choose: the one that the error `elsewhere` named.
SERVER_HEADER = "GARRY-Server"
ADDRESS = re.compile(r"[A-Za-z0-9.:\[\]_-]{1,100}")


class FrameTooLarge(ValueError):
    """A message of more than 64 KiB."""


def _ignore_loss(_reason: str, _pause_s: float) -> None:
    """Ignore a lost connection."""


class Link:
    """A connection to the server that reconnects by itself. Iterating yields the server's messages.

    Parameters
    ----------
    url
        The socket's address, see ``connection_args.websocket_url``.
    token
        The device's token.
    greet
        Returns the first message of each connection.
    on_lost
        Called with a reason and the pause before the next attempt [s], each time a connection is
        lost or cannot be made. A robot stops here.
    store_token
        Stores another token that the server gives in place of this one, in a thread of its own, and
        returns whether the disk has it; None where there is no place for one.
    timing, jitter, sleep
        How long to wait; where chance comes from, in [0, 1); how to pause between attempts.

    Iterating raises ``LinkRefused`` where dialing in again unchanged would not help, and ends after
    ``close``. One task iterates; any task may send.
    """

    def __init__(
        self,
        url: str,
        token: str,
        greet: Callable[[], Message],
        *,
        on_lost: Callable[[str, float], None] = _ignore_loss,
        store_token: Callable[[str], bool] | None = None,
        timing: Timing = TIMING,
        jitter: Callable[[], float] = random.random,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self.url = url
        self._token = token
        self._greet = greet
        self._on_lost = on_lost
        self._store_token = store_token
        self._timing = timing
        self._sleep = sleep
        self._back_off = BackOff(timing, jitter)
        self._socket: ClientConnection | None = None
        self._is_closed = False
        self._was_welcome = False  # on any connection: then a failure is probably temporary
        self._was_heard = False  # on this connection
        self._error = ""  # the last one that the server sent on this connection
        # Which of several servers has the session, as another one reported: for the proxy.
        self._server = ""

    @property
    def is_open(self) -> bool:
        """Whether there is a connection, as far as is known."""
        return self._socket is not None

    async def __aenter__(self) -> Self:
        """Return the link; iterating connects it."""
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close it."""
        await self.close()

    def __aiter__(self) -> Self:
        """Return the link itself."""
        return self

    async def __anext__(self) -> Message:
        """Return the server's next message, after connecting where there is no connection."""
        while not self._is_closed:
            try:
                if self._socket is None:
                    await self._connect()
                else:
                    message = self._read(await self._socket.recv())
                    if message["type"] != "token":
                        return message
                    await self._replace_token(message)
            except ConnectionClosed as closed:
                self._socket = None
                if not self._is_closed:
                    await self.pause(self._explain(closed))
            except (OSError, WebSocketException) as problem:
                await self.pause(self._explain_failure(problem))
        raise StopAsyncIteration

    async def send(self, message: Message) -> bool:
        """Send a message; return False where there is no connection: nothing is queued here.

        True does not mean that it arrived. Raises FrameTooLarge, and ValueError for a number that
        is not finite.
        """
        text = json.dumps(message, separators=(",", ":"), allow_nan=False)
        if len(text) > MAX_FRAME_BYTES:  # json writes ASCII: a character is a byte
            raise FrameTooLarge(f"A frame has at most {MAX_FRAME_BYTES} bytes, not {len(text)}.")
        socket = self._socket
        if socket is None:
            return False
        try:
            async with asyncio.timeout(self._timing.pong_within_s):
                await socket.send(text)
        except TimeoutError:
            # Pings wait for room in the buffer as well and would never time out.
            socket.transport.abort()
        except ConnectionClosed:
            pass
        else:
            return True
        return False

    def hang_up(self) -> None:
        """Abort the connection, with what is still unsent; iterating connects again.

        For callers that expect messages more often than pings.
        """
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.transport.abort()

    async def pause(self, reason: str) -> None:
        """Report a lost connection, and wait before the next attempt.

        Iterating does so by itself, except where it raises: for callers that connect again anyway.
        """
        pause_s = self._back_off.next_s()
        self._on_lost(reason, pause_s)
        await self._sleep(pause_s)

    async def close(self) -> None:
        """Close the connection and end the iteration."""
        self._is_closed = True
        socket, self._socket = self._socket, None
        if socket is not None:
            await socket.close()

    async def _connect(self) -> None:
        headers = {"Authorization": f"Bearer {self._token}"}
        if self._server:
            headers[SERVER_HEADER] = self._server
        socket = await dial(
            self.url,
            self._timing,
            MAX_FRAME_BYTES,
            additional_headers=headers,
            user_agent_header="GARRY",
        )
        self._error, self._was_heard = "", False
        # A server that refuses us may have closed already; iterating then reads its reason.
        with suppress(ConnectionClosed):
            greeting = self._greet() | ({"rotates": True} if self._store_token else {})
            await socket.send(json.dumps(greeting, allow_nan=False))
        if self._is_closed:
            await socket.close()
        else:
            self._socket = socket

    def _read(self, text: str | bytes) -> Message:
        """Return a frame's message. Raises LinkRefused for what no GARRY server sends."""
        try:
            message = json.loads(text)
            kind = message["type"]
        except (ValueError, TypeError, KeyError, RecursionError):
            raise LinkRefused(
                CloseCode.NOT_PROTOCOL,
                f"What answers at {self.url} is no GARRY server. Check the address.",
            ) from None
        if kind == "error":
            self._error = str(message.get("message", ""))
            server = str(message.get("server", ""))
            if server != self._server and ADDRESS.fullmatch(server):
                self._server = server
                self._back_off.reset()
        else:
            self._was_welcome = self._was_heard = True
            self._error = ""
        return dict(message)

    async def _replace_token(self, message: Message) -> None:
        """Store the token that the server gives, and only then confirm it."""
        token = message.get("token")
        if self._store_token is None or not isinstance(token, str) or not token.isascii():
            return
        if await asyncio.to_thread(self._store_token, token):
            self._token = token
            await self.send({"type": "token", "token": token})

    def _explain(self, closed: ConnectionClosed) -> str:
        """Return why a connection ended. Raises LinkRefused where trying again is useless."""
        code = 1006 if closed.rcvd is None else closed.rcvd.code
        reason = self._error or ("" if closed.rcvd is None else closed.rcvd.reason)
        if code in REFUSALS:
            raise LinkRefused(code, reason or REFUSALS[code]) from closed
        if self._was_heard and code not in TROUBLE:
            self._back_off.reset()
        if closed.rcvd is None:
            silent = closed.sent is not None and closed.sent.code == 1011
            return "The server does not answer" if silent else "The connection broke"
        return f"The server closed the connection ({code}{': ' if reason else ''}{reason})"

    def _explain_failure(self, problem: OSError | WebSocketException) -> str:
        """Return why there is no connection. Raises LinkRefused where trying again is useless."""
        self._server = ""  # it may be gone
        if isinstance(problem, ssl.SSLCertVerificationError):
            raise LinkRefused(
                CloseCode.NOT_PROTOCOL,
                f"The certificate of {self.url} cannot be trusted ({problem.verify_message}). "
                "Check the address, this computer's date, and the server's certificate.",
            )
        if isinstance(problem, InvalidStatus):
            status = problem.response.status_code
            code = STATUS_CODES.get(status, CloseCode.NOT_PROTOCOL)
            fatal = status < 500 and status not in PASSING_STATUSES
            # A proxy may answer 404 while the server restarts, but only the server answers 401.
            if fatal and (code == CloseCode.UNAUTHORIZED or not self._was_welcome):
                cure = REFUSALS[code] if status in STATUS_CODES else "Check the address."
                raise LinkRefused(code, f"{self.url} answers with HTTP {status}. {cure}")
            return f"The server answers with HTTP {status}"
        if isinstance(problem.__cause__, EOFError):
            return "The connection broke"
        if isinstance(problem, TimeoutError):
            return f"No answer from {self.url}"
        if isinstance(problem, OSError):
            return f"No server at {self.url} ({problem.strerror or problem})"
        return f"What answers at {self.url} is no websocket ({problem})"
