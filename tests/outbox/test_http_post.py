"""Where messages may go: to the internet, and to no machine that only this server can reach."""

from __future__ import annotations

import socket
import socketserver
import threading
import time
from contextlib import suppress

import pytest

from rehab.outbox import http_post
from rehab.outbox.http_post import Refused, check_address, post, resolve


@pytest.mark.parametrize(
    "address",
    [
        *("127.0.0.1", "10.0.0.7", "192.168.1.1", "172.16.0.1", "169.254.169.254", "100.64.0.1"),
        *("0.0.0.0", "255.255.255.255", "224.0.0.1", "::1", "fe80::1%eth0", "fd00::1", "::"),  # noqa: S104
        *("::ffff:127.0.0.1", "64:ff9b::7f00:1", "2002:7f00:1::", "ff02::1"),
    ],
)
def test_an_address_of_no_internet_is_refused(address):
    with pytest.raises(Refused, match="GARRY_PRIVATE_RECEIVERS"):
        check_address(address, [])


@pytest.mark.parametrize("address", ["93.184.216.34", "2606:4700::1111"])
def test_an_address_of_the_internet_is_not(address):
    check_address(address, [])


def test_a_host_may_allow_a_network():
    check_address("10.1.2.3", ["10.1.0.0/16"])
    check_address("::ffff:10.1.2.3", ["10.1.0.0/16"])
    with pytest.raises(Refused):
        check_address("10.2.0.1", ["10.1.0.0/16"])


def test_a_name_with_one_address_inside_is_refused(monkeypatch):
    answers = [(2, 1, 6, "", (address, 443)) for address in ("93.184.216.34", "10.0.0.1")]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: answers)
    with pytest.raises(Refused):
        resolve("rebind.example", 443, [])


def test_the_address_that_was_checked_is_the_one_that_is_reached(monkeypatch):
    reached = []

    def connect(place, timeout):
        reached.append(place)
        raise ConnectionRefusedError

    monkeypatch.setattr(http_post, "resolve", lambda *_: "93.184.216.34")
    monkeypatch.setattr(socket, "create_connection", connect)
    with pytest.raises(ConnectionRefusedError):
        post("https://receiver.example:8443/hook", b"", {}, [])
    assert reached == [("93.184.216.34", 8443)]


def test_a_receiver_that_dawdles_is_hung_up_on(monkeypatch):
    """Everybody's messages wait behind it. It would send a letter of a header each 10 ms."""
    monkeypatch.setattr(http_post, "TIMEOUT_S", 0.3)
    sent = []

    class Dawdler(socketserver.BaseRequestHandler):
        def handle(self):
            self.request.sendall(b"HTTP/1.1 200 OK\r\nX-Slow: ")
            with suppress(OSError):
                for _ in range(300):
                    self.request.sendall(b"x")
                    sent.append(1)
                    time.sleep(0.01)

    with socketserver.TCPServer(("127.0.0.1", 0), Dawdler) as server:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        with suppress(OSError):
            post(f"http://127.0.0.1:{server.server_address[1]}/", b"", {}, ["127.0.0.1/32"])
        thread.join()
    assert 0 < len(sent) < 200


@pytest.mark.parametrize("url", ["ftp://x.example/", "//x.example/", "https:///", "x", ""])
def test_what_is_no_web_address_is_refused(url):
    with pytest.raises(Refused, match="https"):
        post(url, b"", {}, [])


def test_http_is_for_allowed_networks_alone(monkeypatch):
    monkeypatch.setattr(http_post, "resolve", lambda *_: "93.184.216.34")
    with pytest.raises(Refused, match="Without https"):
        post("http://receiver.example/", b"", {}, [])
