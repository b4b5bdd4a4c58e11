"""A browser or program at a real server: what it keeps, and from which address it comes."""

from __future__ import annotations

import http.client
import json
import ssl
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlencode, urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

CSRF = "c" * 32
SOURCE, HELLO = "/ws/source/", '{"type": "hello", "version": 1, "run": "r", "last": 0}'
PATIENCE_S = 15.0


@dataclass
class Visitor:
    """Somebody at a server, behind a proxy of ours (``GARRY_PROXIES=1``) that tells the address."""

    url: str
    address: str = "127.0.0.1"
    cookies: dict[str, str] = field(default_factory=dict)
    token: str = ""  # of a program or a device
    headers: dict[str, str] = field(default_factory=dict)  # others of each request
    tls: ssl.SSLContext | None = None  # that trusts the server, where it encrypts

    def request(self, method: str, path: str, body: str | bytes = b"", **headers: str) -> Answer:
        """Send a request; keep the cookies of its answer."""
        place = urlsplit(self.url)
        assert place.hostname is not None
        connection = http.client.HTTPConnection(place.hostname, place.port, timeout=60)
        if self.tls is not None:
            connection = http.client.HTTPSConnection(
                place.hostname, place.port, timeout=60, context=self.tls
            )
        try:
            connection.request(method, path, body, self._headers() | headers)
            response = connection.getresponse()
            for name, value in response.getheaders():
                if name.lower() == "set-cookie":
                    key, _, rest = value.partition("=")
                    self.cookies[key] = rest.partition(";")[0]
            return Answer(response.status, dict(response.getheaders()), response.read())
        finally:
            connection.close()

    def get(self, path: str, **headers: str) -> Answer:
        """Open a page."""
        return self.request("GET", path, **headers)

    def post(self, path: str, **form: Any) -> Answer:
        """Send a form, with the token that shows it comes from our page."""
        kind = {"Content-Type": "application/x-www-form-urlencoded"}
        return self.request("POST", path, urlencode(form), **kind)

    def dial(self, path: str) -> ClientConnection:
        """Open a socket. What nobody reads for a while on a busy machine does not break it."""
        own = {name: value for name, value in self._headers().items() if name != "X-CSRFToken"}
        return connect(
            f"ws{self.url.removeprefix('http')}{path}",
            additional_headers=own,
            origin=Origin(self.url),
            open_timeout=PATIENCE_S,
            ping_interval=None,
            max_size=None,
            max_queue=None,
        )

    def watch(self, path: str, hello: str = "") -> tuple[int, str]:
        """Open a socket, and say hello as a source. Return 0 and the snapshot or welcome, or the
        close code and the refusal. A connection that only breaks says nothing: dial again.
        """
        for _ in range(3):
            said = ""
            with self.dial(path) as socket:
                try:
                    if hello:
                        socket.send(hello)
                    while '"snapshot"' not in said and '"welcome"' not in said:
                        said = str(socket.recv(PATIENCE_S))
                except ConnectionClosed as closed:
                    if closed.rcvd is None:
                        continue
                    return closed.rcvd.code, said
            return 0, said
        raise ConnectionError(f"{path} broke three times")

    def _headers(self) -> dict[str, str]:
        cookies = {"csrftoken": CSRF} | self.cookies
        cookies["csrftoken"] = cookies["csrftoken"] or CSRF
        headers = {
            "Cookie": "; ".join(f"{name}={value}" for name, value in cookies.items()),
            "X-Forwarded-For": self.address,
            "X-CSRFToken": cookies["csrftoken"],
        } | self.headers
        return headers | ({"Authorization": f"Bearer {self.token}"} if self.token else {})


@dataclass
class Answer:
    """What a server answers."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        """The body as text."""
        return self.body.decode(errors="replace")

    def json(self) -> Any:
        """Return the body as JSON."""
        return json.loads(self.body)


def until_closed(socket: ClientConnection) -> int:
    """Return the code with which the server closes a socket, whatever it sends before."""
    try:
        while True:
            message = json.loads(socket.recv(PATIENCE_S))
            if "frame" in message:
                socket.send(json.dumps({"type": "seen", "frame": message["frame"]}))
    except ConnectionClosed as closed:
        return closed.rcvd.code if closed.rcvd else 0
