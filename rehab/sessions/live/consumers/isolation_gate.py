"""The gate before pages and sockets: closed while this server is cut off from the database.

It answers /livez by itself, on the event loop: the proxy asks whether that turns, each second.
"""

from __future__ import annotations

from typing import Any

from rehab.sessions.live import runtime as runtimes
from robot.wire.close_codes import CloseCode

LIVE = "/livez"
WATCHED = ("/healthz", "/readyz", "/metrics")  # for watchdogs, which ask this server and no other
STATUS = 504  # deploy/haproxy: the proxy asks another server
WORDS = b"This server is cut off from its database. Try again: another one answers.\n"


class IsolationGate:
    """An ASGI application that answers watchdogs alone while this server is cut off."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or refuse it so that the proxy asks another server."""
        live = runtimes.peek()
        is_isolated = live is not None and live.servers is not None and live.servers.is_isolated
        if scope["type"] == "http" and scope["path"] == LIVE:
            is_ready = live is not None and live.is_ready and not is_isolated
            await answer(send, 200 if is_ready else 503, b"ok\n" if is_ready else b"not ready\n")
        elif not is_isolated or scope.get("path") in WATCHED:
            await self._inner(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.accept"})
            await send({"type": "websocket.close", "code": int(CloseCode.RESTARTING)})
        else:
            await answer(send, STATUS, WORDS)


async def answer(send: Any, status: int, words: bytes) -> None:
    """Answer with a status and a text, which no proxy may store."""
    headers = [(b"content-type", b"text/plain"), (b"cache-control", b"no-store")]
    headers += [(b"retry-after", b"1")] if status >= 500 else []
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": words})
