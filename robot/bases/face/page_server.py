"""Serves the avatar's page, and sends every open one what to show. It takes no orders from them."""

from __future__ import annotations

import json
import threading
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from typing import Any

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from robot.motion.face_and_arms import REST, to_message

SOCKET_PATH = "/avatar"
FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/avatar.js": ("avatar.js", "text/javascript; charset=utf-8"),
}
POLICY = "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; connect-src 'self' ws:"
MAX_PAGES = 8
CLOSE_WITHIN_S = 2.0

PageState = dict[str, Any]


class PageServer:
    """A web server on threads of its own. Raises OSError where the address is taken.

    Pages get the newest state, never a queue of old ones; each answer has a number, so that a page
    gives it once.
    """

    def __init__(self, host: str, port: int) -> None:
        self._state: PageState = {
            "state": "waiting",
            "pose": [0, 0, 0],
            "answer": None,
            "answers": 0,
            "act": "rest",
            "look": to_message(REST),
        }
        self._changed = threading.Condition()
        self._version = self._pages = 0
        self._is_closing = False
        self._server = serve(
            self._serve_page,
            host,
            port,
            process_request=self._serve_file,
            compression=None,
            max_size=1024,
        )
        self.url = "http://{}:{}/".format(*self._server.socket.getsockname()[:2])
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def show(self, **parts: Any) -> None:
        """Show parts of the state. Never waits."""
        with self._changed:
            if any(self._state[name] != part for name, part in parts.items()):
                self._state |= parts
                self._version += 1
                self._changed.notify_all()

    def say(self, answer: PageState) -> None:
        """Show an answer, also where it is the same as the one before."""
        self.show(answer=answer, answers=self._state["answers"] + 1)

    def close(self) -> None:
        """Close all pages. Never raises."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        with suppress(OSError):
            self._server.shutdown()
        self._thread.join(CLOSE_WITHIN_S)

    def _serve_file(self, _socket: ServerConnection, request: Request) -> Response | None:
        path = request.path.partition("?")[0]
        if path == SOCKET_PATH:
            return None
        if path not in FILES:
            return _respond(HTTPStatus.NOT_FOUND, "text/plain", b"There is only one page here: /")
        name, kind = FILES[path]
        return _respond(HTTPStatus.OK, kind, files(__package__).joinpath(name).read_bytes())

    def _serve_page(self, socket: ServerConnection) -> None:
        """Send one page what to show until it is gone."""
        with self._changed:
            if self._pages >= MAX_PAGES:
                return
            self._pages += 1
        try:
            with suppress(ConnectionClosed):
                self._send_states(socket)
        finally:
            with self._changed:
                self._pages -= 1

    def _send_states(self, socket: ServerConnection) -> None:
        sent = -1
        while True:
            with self._changed:
                while sent == self._version and not self._is_closing:
                    self._changed.wait(1.0)
                    if socket.close_code is not None:
                        return
                if self._is_closing:
                    return
                sent, text = self._version, json.dumps(self._state)
            socket.send(text)


def _respond(status: HTTPStatus, kind: str, body: bytes) -> Response:
    headers = Headers()
    headers["Content-Type"] = kind
    headers["Content-Length"] = str(len(body))
    headers["Content-Security-Policy"] = POLICY
    headers["Cache-Control"] = "no-store"
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, body)
