"""Nobody fills the server's memory or disk with what is posted."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
from django.test import Client

from tests.support.servers import Server, serve

pytestmark = pytest.mark.server

HEAD = b"POST /sign-in/ HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
TOO_MUCH = 3 * 1024 * 1024


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serve(tmp_path_factory.mktemp("data")) as running:
        yield running


def post(server: Server, head: bytes, body: bytes) -> bytes:
    """Send a body; return what is answered until the server hangs up."""
    answer = b""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        try:
            connection.sendall(HEAD + head + b"\r\n" + body)
            while part := connection.recv(65536):
                answer += part
        except (BrokenPipeError, ConnectionResetError):
            pass  # the server had hung up before all was sent
    return answer


def chunked(body: bytes) -> bytes:
    size = 64 * 1024
    parts = (body[start : start + size] for start in range(0, len(body), size))
    return b"".join(b"%x\r\n%s\r\n" % (len(part), part) for part in parts) + b"0\r\n\r\n"


def test_the_server_hangs_up_on_a_body_without_end(server):
    body = b"x" * TOO_MUCH
    for head, sent in (
        (b"Content-Length: %d\r\n" % TOO_MUCH, body),
        (b"Transfer-Encoding: chunked\r\n", chunked(body)),
    ):
        answer = post(server, head, sent)
        assert answer == b"" or answer.startswith(b"HTTP/1.1 413 ")
    assert b"403" in post(server, b"Content-Length: 3\r\n", b"a=b")  # it serves on: no CSRF token


@pytest.mark.django_db
def test_no_page_takes_files(tmp_path):
    file = tmp_path / "walk.csv"
    file.write_text("a2\n3.1\n")
    with file.open() as opened:
        answer = Client().post("/sign-in/", {"username": "pt", "upload": opened})
    assert answer.status_code == 400
