"""Addresses and tokens: what is taken, and what is refused with an example."""

import pytest

from robot.connection_args import BadConnectionArgs, check_token, websocket_url


@pytest.mark.parametrize(
    ("server", "url"),
    [
        ("http://127.0.0.1:8000", "ws://127.0.0.1:8000/ws/source/"),
        ("https://garry.example/", "wss://garry.example/ws/source/"),
        (" ws://[::1]:8000 ", "ws://[::1]:8000/ws/source/"),
        ("wss://example.org/gait", "wss://example.org/gait/ws/source/"),
    ],
)
def test_a_server_address_becomes_a_websocket_address(server, url):
    assert websocket_url(server, "/ws/source/") == url


@pytest.mark.parametrize(
    "server",
    [
        *("", "127.0.0.1:8000", "localhost", "ftp://host", "http://", "http://host:port"),
        *("http://host:99999", "http://host/?a=1", "http://host/#a", "http://me:pw@host"),
    ],
)
def test_what_is_no_address_is_refused_with_an_example(server):
    with pytest.raises(BadConnectionArgs, match="http://127.0.0.1:8000"):
        websocket_url(server, "/ws/source/")


def test_a_token_loses_its_blanks():
    assert check_token(" abc-_1\n") == "abc-_1"


@pytest.mark.parametrize("token", ["", "  ", "a b", "a\nb", "ä", "a\r\nX: y"])
def test_what_is_no_token_is_refused(token):
    with pytest.raises(BadConnectionArgs, match="Copy it"):
        check_token(token)
