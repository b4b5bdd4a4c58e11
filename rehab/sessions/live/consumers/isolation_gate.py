"""The gate before pages and sockets: closed while this server is cut off from the database."""

from __future__ import annotations

from typing import Any

from rehab.sessions.live import runtime as runtimes

WATCHED = ("/healthz", "/readyz", "/metrics")  # for watchdogs, which ask this server and no other
STATUS = 504  # deploy/nginx: the proxy asks another server
WORDS = b"This server is cut off from its database. Try again: another one answers.\n"


class IsolationGate:
    """An ASGI application that answers watchdogs alone while this server is cut off."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or refuse it so that the proxy asks another server."""
        live = runtimes.peek()
        if (
            live is None
            or live.servers is None
            or not live.servers.is_isolated
            or scope.get("path") in WATCHED
        ):
            await self._inner(scope, receive, send)
            return
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close"})  # the proxy sees 403
            return
        headers = [(b"content-type", b"text/plain"), (b"retry-after", b"1")]
        await send({"type": "http.response.start", "status": STATUS, "headers": headers})
        await send({"type": "http.response.body", "body": WORDS})
