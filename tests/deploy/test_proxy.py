"""HAProxy by our configuration, before two servers of which one sends clients to the other."""

from __future__ import annotations

import asyncio
import http.client
import ssl
import threading
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from tests.support.hosted import find_haproxy, run_haproxy
from tests.support.servers import free_port

pytestmark = [
    pytest.mark.server,
    pytest.mark.skipif(find_haproxy() is None, reason="apt-get install haproxy"),
]
CLIENTS = 12  # who dial again at once, and stay


def answer_check(socket: ServerConnection, request: Request, status: HTTPStatus) -> Response | None:
    """Answer the proxy's check; None for sockets."""
    return socket.respond(status, "") if request.path == "/livez" else None


@asynccontextmanager
async def run_server(port: int, *, is_cut_off: bool = False) -> AsyncIterator[None]:
    """Answer sockets by a server's port, or send them away as one that lacks its database does."""

    async def stay(socket: ServerConnection) -> None:
        if is_cut_off:
            await socket.close(4012)
            return
        await socket.send(str(port))
        await socket.wait_closed()

    def check(socket: ServerConnection, request: Request) -> Response | None:
        status = HTTPStatus.SERVICE_UNAVAILABLE if is_cut_off else HTTPStatus.OK
        return answer_check(socket, request, status)

    async with serve(stay, "127.0.0.1", port, process_request=check):
        await asyncio.sleep(2.5)  # until the proxy has found it, or that it is cut off
        yield


class Hung:
    """A server that accepts connections, and from some time on answers nothing."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.is_silent = False

    @asynccontextmanager
    async def run(self) -> AsyncIterator[None]:
        async def stay(socket: ServerConnection) -> None:
            await socket.send(str(self.port))
            await socket.wait_closed()

        async def check(socket: ServerConnection, request: Request) -> Response | None:
            while self.is_silent:  # noqa: ASYNC110
                await asyncio.sleep(0.1)
            return answer_check(socket, request, HTTPStatus.OK)

        async with serve(stay, "127.0.0.1", self.port, process_request=check, open_timeout=3600):
            await asyncio.sleep(2.5)
            yield
            self.is_silent = False


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
    with run_haproxy(tmp_path / "haproxy", *ports) as (_, secure, tls):
        url = f"wss{secure.removeprefix('https')}/ws/"
        for gone, other in (ports, ports[::-1]):
            async with run_server(other):
                assert await dial_all(url, tls) == {str(other)}
            async with run_server(gone), run_server(other, is_cut_off=True):
                assert await dial_all(url, tls) == {str(gone)}


async def test_a_browser_and_a_device_choose_the_server_that_has_their_clinic(tmp_path: Path):
    ports = (free_port(), free_port())
    with run_haproxy(tmp_path / "haproxy", *ports) as (_, secure, tls):
        url = f"wss{secure.removeprefix('https')}/ws/"
        async with run_server(ports[0]), run_server(ports[1]):
            for port in ports:
                chosen = f"127.0.0.1:{port}"
                cookie = {"Cookie": f"sessionid=x; garry_server={chosen}"}
                for headers in ({"GARRY-Server": chosen}, cookie):
                    assert await dial_all(url, tls, headers) == {str(port)}


def test_the_sockets_of_a_server_that_is_silent_are_cut_and_come_back_elsewhere(tmp_path: Path):
    """It still accepts connections, as a process does that hangs."""

    async def story(url: str, tls: ssl.SSLContext, hung: Hung, port: int) -> list[float]:
        took_s = []
        chosen = {"GARRY-Server": f"127.0.0.1:{hung.port}"}
        async with run_server(port), hung.run():
            socket = await connect(url, ssl=tls, proxy=None, additional_headers=chosen)
            assert await socket.recv() == str(hung.port)
            hung.is_silent, began_s = True, time.monotonic()
            await socket.wait_closed()
            took_s.append(time.monotonic() - began_s)
            assert await dial_all(url, tls, chosen) == {str(port)}
            took_s.append(time.monotonic() - began_s)
        return took_s

    ports = (free_port(), free_port())
    with run_haproxy(tmp_path / "haproxy", *ports) as (_, secure, tls):
        url = f"wss{secure.removeprefix('https')}/ws/"
        took_s = asyncio.run(story(url, tls, Hung(ports[0]), ports[1]))
    print("cut, and elsewhere, after", [round(one, 1) for one in took_s], "s")
    assert max(took_s) < 8.0  # 5 s, on a machine that does much else


@pytest.mark.parametrize(("shown", "least"), [("token", 700), ("cookie", 700), ("", 700)])
def test_each_device_is_limited_by_itself_behind_one_address(tmp_path: Path, shown, least):
    """Also where another one at the same address sends too much, and so is refused."""
    ports = (free_port(), free_port())

    def ask(who: str) -> int:
        headers = {
            "token": {"Authorization": f"Bearer {who}"},
            "cookie": {"Cookie": f"sessionid={who}"},
        }
        request = urllib.request.Request(f"{secure}/x", headers=headers.get(shown, {}))  # noqa: S310
        try:
            with opener.open(request, timeout=20) as answer:
                return int(answer.status)
        except urllib.error.HTTPError as answer:
            return answer.code
        except http.client.RemoteDisconnected:  # who stalls on a busy machine is dropped
            return 0

    with (
        run_haproxy(tmp_path / "haproxy", *ports) as (_, secure, tls),
        run_pages(ports[0]),
        run_pages(ports[1]),
    ):
        opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=tls))
        with ThreadPoolExecutor(8) as pool:
            answers = Counter(pool.map(ask, ["one"] * (least + 100)))
        assert answers[429] > 0
        assert answers[429] <= 100 + 0.03 * least, answers  # its window slides
        assert answers[200] > 0.5 * least, answers  # others were dropped on a busy machine
        assert ask("another") == (200 if shown else 429)


def test_a_hospital_behind_one_address_has_all_its_sockets(tmp_path: Path):
    """300 sessions, each with a tablet, a therapist's page, a source and a robot."""

    async def story(url: str, tls: ssl.SSLContext, port: int) -> int:
        async with run_server(port), AsyncExitStack() as stack:

            async def dial(number: int) -> str:
                shown = {"Authorization": f"Bearer {number}"}
                dialed = connect(
                    url, ssl=tls, proxy=None, additional_headers=shown, open_timeout=60
                )
                return str(await (await stack.enter_async_context(dialed)).recv())

            found = 0
            for first in range(0, 1200, 100):
                said = await asyncio.gather(*map(dial, range(first, first + 100)))
                found += said.count(str(port))
            return found

    ports = (free_port(), free_port())
    with run_haproxy(tmp_path / "haproxy", *ports) as (_, secure, tls):
        url = f"wss{secure.removeprefix('https')}/ws/"
        assert asyncio.run(story(url, tls, ports[0])) == 1200


@contextmanager
def run_pages(port: int) -> Iterator[None]:
    """Answer everything with 200, as a server that is there."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    class Pages(ThreadingHTTPServer):
        daemon_threads, request_queue_size = True, 128  # the usual 5 overflow on a busy machine

    with Pages(("127.0.0.1", port), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            thread.join()
