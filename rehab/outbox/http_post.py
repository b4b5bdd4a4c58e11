"""Posts to an address that a clinic's lead typed: never to a machine that only we can reach.

A name is resolved once, each of its addresses is checked, and the connection is made to the address
that was checked, so that a second answer of the name server changes nothing. Redirects are not
followed, and proxies of the environment are not used.
"""

from __future__ import annotations

import socket
import ssl
from collections.abc import Mapping, Sequence
from contextlib import suppress
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from ipaddress import IPv4Address, IPv6Address, ip_address, ip_network
from threading import Timer
from typing import NamedTuple
from urllib.parse import urlsplit

TIMEOUT_S = 10.0  # to connect, and then for the whole answer: others wait behind a slow one
MAX_ANSWER_BYTES = 2000
# Prefixes through which an IPv6 address reaches an IPv4 one.
TRANSLATED = [ip_network(text) for text in ("64:ff9b::/96", "64:ff9b:1::/48", "2002::/16")]


class Refused(Exception):
    """An address that is not posted to; the message says why, and the cure."""


class Answer(NamedTuple):
    """A receiver's answer."""

    status: int
    text: str


def check_address(address: str, allowed: Sequence[str]) -> None:
    """Raise Refused for an address of a private network that is not allowed.

    ``allowed``: networks, as 10.1.0.0/16.
    """
    found: IPv4Address | IPv6Address = ip_address(address.partition("%")[0])
    found = getattr(found, "ipv4_mapped", None) or found
    if any(found in ip_network(one) for one in allowed):
        return
    translated = any(found in one for one in TRANSLATED)
    if translated or found.is_multicast or not found.is_global:
        raise Refused(
            f"{found} is no address of the internet. A host allows networks by "
            "GARRY_PRIVATE_RECEIVERS."
        )


def resolve(host: str, port: int, allowed: Sequence[str]) -> str:
    """Return an address of a host, all of whose addresses may be posted to.

    Raises Refused, and OSError where the name is not known.
    """
    found = [str(one[4][0]) for one in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
    for address in found:
        check_address(address, allowed)
    return found[0]


class _PinnedConnection(HTTPConnection):
    """Connects to an address that was checked, under the name that was asked for."""

    def __init__(self, host: str, port: int, address: str, context: ssl.SSLContext | None) -> None:
        super().__init__(host, port, timeout=TIMEOUT_S)
        self.default_port = (HTTPSConnection if context else HTTPConnection).default_port
        self._address, self._context = address, context

    def connect(self) -> None:
        self.sock = socket.create_connection((self._address, self.port), TIMEOUT_S)
        if self._context is not None:
            self.sock = self._context.wrap_socket(self.sock, server_hostname=self.host)


def post(
    url: str,
    body: bytes,
    headers: Mapping[str, str],
    allowed: Sequence[str],
    context: ssl.SSLContext | None = None,
) -> Answer:
    """Return the answer to a post.

    Parameters
    ----------
    url
        https, or http at an allowed address of a private network.
    body, headers
        What is posted.
    allowed
        Networks that may be posted to beside the internet.
    context
        What certificates are checked by; by default those that the computer trusts.

    Raises
    ------
    Refused
        For an address that is not posted to.
    OSError
        Where nobody answers, or nobody with a valid certificate.
    """
    place = urlsplit(url)
    is_encrypted = place.scheme == "https"
    if place.scheme not in ("http", "https") or not place.hostname:
        raise Refused("An address begins with https://.")
    try:
        port = place.port or (443 if is_encrypted else 80)
    except ValueError:
        raise Refused("Its port is no number from 1 to 65535.") from None
    address = resolve(place.hostname, port, allowed)
    if not is_encrypted and not any(ip_address(address) in ip_network(one) for one in allowed):
        raise Refused("Without https a message could be read on its way. Give https://….")
    secure = (context or ssl.create_default_context()) if is_encrypted else None
    connection = _PinnedConnection(place.hostname, port, address, secure)
    path = (place.path or "/") + (f"?{place.query}" if place.query else "")
    late: Timer | None = None
    try:
        connection.connect()
        late = Timer(TIMEOUT_S, _hang_up, [connection.sock])
        late.start()
        connection.request("POST", path, body, dict(headers))
        answer = connection.getresponse()
        return Answer(answer.status, answer.read(MAX_ANSWER_BYTES).decode(errors="replace"))
    except HTTPException as problem:
        raise OSError(f"{type(problem).__name__}: {problem}") from None
    finally:
        if late is not None:
            late.cancel()
        connection.close()


def _hang_up(sock: socket.socket) -> None:
    """End a connection that another thread reads from; it reads the end."""
    with suppress(OSError):
        socket.socket.shutdown(sock, socket.SHUT_RDWR)
