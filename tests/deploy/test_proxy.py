"""nginx by our configuration, before two servers of which one sends clients to the other."""

from __future__ import annotations

import ssl
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from http import HTTPStatus
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from tests.support.hosted import find_nginx, run_nginx
from tests.support.servers import free_port

pytestmark = [
    pytest.mark.server,
    pytest.mark.skipif(find_nginx() is None, reason="apt-get install nginx-light"),
]
CLIENTS = 12  # who dial again at once, and stay


@asynccontextmanager
async def run_server(port: int, *, is_cut_off: bool = False) -> AsyncIterator[None]:
    """Answer sockets by a server's port, or send them away as one that lacks its database does."""

    async def stay(socket: ServerConnection) -> None:
        await socket.send(str(port))
        await socket.wait_closed()

    def refuse(socket: ServerConnection, _: Request) -> Response | None:
        return socket.respond(HTTPStatus.GATEWAY_TIMEOUT, "cut off") if is_cut_off else None

    async with serve(stay, "127.0.0.1", port, process_request=refuse):
        yield


async def dial_all(url: str, tls: ssl.SSLContext) -> set[str]:
    """Return the ports of those who answer clients that come one by one and stay."""
    async with AsyncExitStack() as stack:
        answers = set()
        for _ in range(CLIENTS):
            socket = await stack.enter_async_context(connect(url, ssl=tls, proxy=None))
            answers.add(str(await socket.recv()))
        return answers


async def test_a_server_that_failed_once_takes_all_clients_as_soon_as_it_is_back(tmp_path: Path):
    """Each of the two in turn; sockets last for a whole walk, so that none ends meanwhile."""
    ports = (free_port(), free_port())
    with run_nginx(tmp_path / "nginx", *ports) as (_, secure, tls):
        url = f"wss{secure.removeprefix('https')}/ws/"
        for gone, other in (ports, ports[::-1]):
            async with run_server(other):
                assert await dial_all(url, tls) == {str(other)}
            async with run_server(gone), run_server(other, is_cut_off=True):
                assert await dial_all(url, tls) == {str(gone)}
