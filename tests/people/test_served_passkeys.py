"""A passkey at a real server: nobody signs in with one signed before, elsewhere, or by a copy."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.accounts import PASSWORD
from tests.support.passkey import SoftPasskey
from tests.support.servers import Server, serve
from tests.support.visitors import Visitor

pytestmark = pytest.mark.server

SEED = """
from tests.support.accounts import add_account
from tests.support.world import signed_in
print(signed_in(add_account()).cookies["sessionid"].value)
"""
SIGN_IN, SECOND_FACTOR, ADD = "/sign-in/", "/sign-in/code/", "/account/second-factor/passkey/"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serve(tmp_path_factory.mktemp("data"), settings={"GARRY_PROXIES": "1"}) as running:
        yield running


def visitor(server: Server, cookie: str = "") -> Visitor:
    """Return a browser at the server's name: there are no passkeys for an address of numbers."""
    return Visitor(
        f"http://localhost:{server.port}", cookies={"sessionid": cookie} if cookie else {}
    )


def options_of(browser: Visitor, path: str) -> dict[str, Any]:
    found = re.search(r'data-passkey="([^"]*)"', browser.get(path).text)
    assert found
    asked: dict[str, Any] = json.loads(html.unescape(found[1]))
    return asked


def pending(server: Server) -> tuple[Visitor, dict[str, Any]]:
    """Return a browser that has shown the password, and what its passkey is to sign."""
    browser = visitor(server)
    shown = browser.post(SIGN_IN, username="rosa", password=PASSWORD)
    assert shown.headers["Location"] == SECOND_FACTOR
    return browser, options_of(browser, SECOND_FACTOR)


def proves(browser: Visitor, answer: str) -> bool:
    browser.post(SECOND_FACTOR, passkey=answer)
    return browser.get("/start/").status == 200


def test_only_the_own_passkey_signs_in_here_and_once(server):
    key = SoftPasskey(f"http://localhost:{server.port}", counter=7)
    owner = visitor(server, server.run_shell(SEED).splitlines()[-1])
    made = key.create(options_of(owner, ADD))
    assert owner.post(ADD, name="Key", passkey=made).status in (200, 302)

    browser, options = pending(server)
    assert not proves(browser, key.sign(options))  # its counter stands, as a copy's does

    key.counter, here = 8, key.origin
    browser, options = pending(server)
    key.origin = "http://localhost:1"
    assert not proves(browser, key.sign(options))

    key.origin = here
    browser, options = pending(server)
    signed = key.sign(options)
    other, _ = pending(server)
    assert not proves(other, signed)
    assert proves(browser, signed)

    again, _ = pending(server)
    assert not proves(again, signed)
