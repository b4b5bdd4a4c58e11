"""Signing in at a real server: in, wrong, locked out, by a code; and many attempts at once."""

from __future__ import annotations

import asyncio
import http.client
import re
import time
from collections.abc import Iterator
from urllib.parse import urlencode

import pytest

from rehab.people.sign_in.factors.totp import TIME_STEP_S, generate_code
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

    def send(self, method: str, path: str, **form: str) -> tuple[int, dict[str, str], str]:
        """Send a request; keep its cookies; return status, headers and page."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=60)
        headers, body = self.request(form)
        connection.request(method, path, body if method == "POST" else None, headers)
        answer = connection.getresponse()
        page = answer.read().decode()
        for name, value in answer.getheaders():
            if name.lower() == "set-cookie":
                key, _, rest = value.partition("=")
                self.cookies[key] = rest.partition(";")[0]
        connection.close()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, page

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

    def enter(self, password: str, username: str = "pt") -> tuple[int, dict[str, str], str]:
        """Fill in the sign-in page."""
        self.send("GET", "/sign-in/")
        return self.send("POST", "/sign-in/", username=username, password=password)

    def is_in(self) -> bool:
        return self.send("GET", "/account/")[0] == 200


def test_signing_in_and_out(server):
    browser = Browser(server, "192.0.2.1")
    assert browser.enter("wrong")[0] == 200
    assert not browser.is_in()
    status, headers, _ = browser.enter(server.password)
    assert (status, headers["location"]) == (302, "/start/")
    assert browser.is_in()
    assert browser.send("POST", "/sign-out/")[0] == 302
    assert not browser.is_in()


def test_a_lockout_is_told_with_the_time_to_wait(server):
    browser = Browser(server, "192.0.2.2")
    assert [browser.enter("wrong")[0] for _ in range(5)] == [200, 200, 200, 200, 429]
    for _ in range(2):  # for a right password, too
        status, headers, page = browser.enter(server.password)
        assert status == 429
        assert 800 < int(headers["retry-after"]) <= 900
        assert "Too many wrong tries. Try again in 15 minutes" in page
    assert not browser.is_in()


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
    browsers[0].send("GET", "/sign-in/")
    forms = []
    for number, browser in enumerate(browsers):
        browser.cookies = dict(browsers[0].cookies)
        forms.append({"username": "pt", "password": f"wrong {number}"})
    forms[-1]["password"] = server.password
    codes = asyncio.run(send_at_once(server, browsers, "/sign-in/", forms))
    assert 302 not in codes
    assert codes.count(429) >= AT_ONCE - 5


def test_a_right_code_after_99_wrong_ones_sent_at_once_does_not_open(server):
    """Last of all: it gives the account a second factor."""
    owner = Browser(server, "192.0.2.10")
    owner.enter(server.password)
    page = owner.send("GET", "/account/second-factor/app/")[2]
    secret = re.search(r'class="secret">([^<]+)<', page)[1].replace(" ", "")
    first = generate_code(secret, int(time.time()) // TIME_STEP_S)
    assert owner.send("POST", "/account/second-factor/app/", code=first)[0] == 200

    thief = Browser(server, "192.0.2.20")
    status, headers, _ = thief.enter(server.password)
    assert (status, headers["location"]) == (302, "/sign-in/code/")
    browsers, forms = [], []
    for number in range(AT_ONCE):  # from many addresses: the gate lets some of each in
        browser = Browser(server, f"203.0.113.{number}")
        browser.cookies = dict(thief.cookies)
        browsers.append(browser)
        forms.append({"code": f"{number:06}"})
    forms[-1]["code"] = generate_code(secret, int(time.time()) // TIME_STEP_S + 1)
    codes = asyncio.run(send_at_once(server, browsers, "/sign-in/code/", forms))
    assert 302 not in codes
    assert codes.count(429) >= AT_ONCE - 5
    assert not thief.is_in()
    assert thief.send("POST", "/sign-in/code/", code=forms[-1]["code"])[0] == 429
