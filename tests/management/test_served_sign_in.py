"""Many attempts to sign in at once, at a real server."""

from __future__ import annotations

import asyncio
import http.client
from collections.abc import Iterator
from urllib.parse import urlencode

import pytest

from tests.support.servers import Server, serve

pytestmark = pytest.mark.server
AT_ONCE = 100


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    # Behind a proxy of ours, so that each test comes from addresses of its own.
    folder = tmp_path_factory.mktemp("data")
    with serve(folder, settings={"GARRY_PROXIES": "1"}) as running:
        yield running


class Browser:
    """What a browser keeps and sends, from one address."""

    def __init__(self, server: Server, address: str) -> None:
        self.server, self.address = server, address
        self.cookies: dict[str, str] = {}

    def open(self, path: str) -> None:
        """Open a page, and keep its cookies."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=60)
        connection.request("GET", path, None, self.request({})[0])
        for name, value in connection.getresponse().getheaders():
            if name.lower() == "set-cookie":
                key, _, rest = value.partition("=")
                self.cookies[key] = rest.partition(";")[0]
        connection.close()

    def request(self, form: dict[str, str]) -> tuple[dict[str, str], str]:
        """Return headers and body of a request with a form."""
        token = {"csrfmiddlewaretoken": self.cookies.get("csrftoken", "")}
        cookies = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        headers = {
            "Content-Type": "application/x-www-form-urlencoded",
            "Cookie": cookies,
            "X-Forwarded-For": self.address,
        }
        return headers, urlencode(token | form)


async def send_at_once(server: Server, browsers: list[Browser], path: str, forms) -> list[int]:
    """Open a connection each, then send all requests in one go; return the status codes."""

    async def connect() -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection("127.0.0.1", server.port)

    connections = [await connect() for _ in browsers]
    for browser, form, (_, writer) in zip(browsers, forms, connections, strict=True):
        headers, body = browser.request(form)
        lines = [f"POST {path} HTTP/1.1", "Host: localhost", "Connection: close"]
        lines += [f"{name}: {value}" for name, value in headers.items()]
        lines += [f"Content-Length: {len(body)}", "", body]
        writer.write("\r\n".join(lines).encode())

    async def status(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> int:
        code = int((await reader.readline()).split()[1])
        await reader.read()
        writer.close()
        return code

    return await asyncio.gather(*(status(*one) for one in connections))


def test_a_right_password_after_99_wrong_ones_sent_at_once_does_not_open(server):
    browsers = [Browser(server, "192.0.2.3") for _ in range(AT_ONCE)]
    browsers[0].open("/sign-in/")
    forms = []
    for number, browser in enumerate(browsers):
        browser.cookies = dict(browsers[0].cookies)
        forms.append({"username": "pt", "password": f"wrong {number}"})
    forms[-1]["password"] = server.password
    codes = asyncio.run(send_at_once(server, browsers, "/sign-in/", forms))
    assert 302 not in codes
    assert codes.count(429) >= AT_ONCE - 5
