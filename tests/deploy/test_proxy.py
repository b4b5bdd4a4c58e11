"""nginx by our configuration, before two servers of which one sends clients to the other."""

from __future__ import annotations

import ssl
import threading
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
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


async def dial_all(
    url: str, tls: ssl.SSLContext, headers: dict[str, str] | None = None
) -> set[str]:
    """Return the ports of those who answer clients that come one by one and stay."""
    async with AsyncExitStack() as stack:
        answers = set()
        for _ in range(CLIENTS):
            socket = await stack.enter_async_context(
                connect(url, ssl=tls, proxy=None, additional_headers=headers)
            )
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


async def test_a_browser_and_a_device_choose_the_server_that_has_their_clinic(tmp_path: Path):
    ports = (free_port(), free_port())
    with run_nginx(tmp_path / "nginx", *ports) as (_, secure, tls):
        url = f"wss{secure.removeprefix('https')}/ws/"
        async with run_server(ports[0]), run_server(ports[1]):
            for port in ports:
                chosen = f"127.0.0.1:{port}"
                cookie = {"Cookie": f"sessionid=x; garry_server={chosen}"}
                for headers in ({"GARRY-Server": chosen}, cookie):
                    assert await dial_all(url, tls, headers) == {str(port)}


@contextmanager
def run_pages(port: int, other: int | None = None) -> Iterator[None]:
    """Answer a form with its own body, or send it to another server."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200 if other is None else 421)
            if other is not None:
                self.send_header("GARRY-Server", f"127.0.0.1:{other}")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", port), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            thread.join()


def test_a_form_at_the_wrong_server_arrives_whole_at_the_right_one(tmp_path: Path):
    ports, body = (free_port(), free_port()), b"goal=3.5&words=" + b"x" * 50_000
    with (
        run_nginx(tmp_path / "nginx", *ports) as (_, secure, tls),
        run_pages(ports[0], other=ports[1]),
        run_pages(ports[1]),
    ):
        for _ in range(6):  # whichever is asked first
            with urllib.request.urlopen(f"{secure}/patients/", body, 20, context=tls) as answer:  # noqa: S310
                assert (answer.status, answer.read()) == (200, body)


def test_two_servers_that_send_a_form_to_each_other_end_with_421(tmp_path: Path):
    ports = (free_port(), free_port())
    with (
        run_nginx(tmp_path / "nginx", *ports) as (_, secure, tls),
        run_pages(ports[0], other=ports[1]),
        run_pages(ports[1], other=ports[0]),
        pytest.raises(urllib.error.HTTPError, match="421"),
    ):
        urllib.request.urlopen(f"{secure}/patients/", b"x=1", 20, context=tls)  # noqa: S310
