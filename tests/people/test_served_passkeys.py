"""Second factors at a real server: none counts twice, from elsewhere, or in a planted session."""

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
import json
from tests.support.accounts import add_account, add_app
from tests.support.world import signed_in
cookie = signed_in(add_account()).cookies["sessionid"].value
print(json.dumps([cookie, add_app(add_account("rolf"))[1]]))
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


@pytest.fixture(scope="module")
def seeded(server: Server) -> tuple[str, list[str]]:
    """Return the cookie of rosa, who is signed in, and the recovery codes of rolf."""
    cookie, codes = json.loads(server.run_shell(SEED).splitlines()[-1])
    return cookie, codes


def options_of(browser: Visitor, path: str) -> dict[str, Any]:
    found = re.search(r'data-passkey="([^"]*)"', browser.get(path).text)
    assert found
    asked: dict[str, Any] = json.loads(html.unescape(found[1]))
    return asked


def half_way(server: Server, username: str, cookie: str = "") -> Visitor:
    """Return a browser that has shown the password."""
    browser = visitor(server, cookie)
    shown = browser.post(SIGN_IN, username=username, password=PASSWORD)
    assert shown.headers["Location"] == SECOND_FACTOR
    return browser


def pending(server: Server) -> tuple[Visitor, dict[str, Any]]:
    """Return a browser that has shown rosa's password, and what her passkey is to sign."""
    browser = half_way(server, "rosa")
    return browser, options_of(browser, SECOND_FACTOR)


def is_in(browser: Visitor) -> bool:
    return browser.get("/start/").status == 200


def proves(browser: Visitor, answer: str) -> bool:
    browser.post(SECOND_FACTOR, passkey=answer)
    return is_in(browser)


def test_a_recovery_code_counts_once(server, seeded):
    for counts in (True, False):
        browser = half_way(server, "rolf")
        browser.post(SECOND_FACTOR, code=seeded[1][0])
        assert is_in(browser) == counts


def test_a_session_that_somebody_planted_stays_a_strangers(server, seeded):
    planted = half_way(server, "rolf").cookies["sessionid"]
    victim = half_way(server, "rolf", planted)
    between = victim.cookies["sessionid"]
    victim.post(SECOND_FACTOR, code=seeded[1][1])
    assert is_in(victim)
    assert len({planted, between, victim.cookies["sessionid"]}) == 3
    assert not any(is_in(visitor(server, key)) for key in (planted, between))


def test_only_the_own_passkey_signs_in_here_and_once(server, seeded):
    key = SoftPasskey(f"http://localhost:{server.port}", counter=7)
    owner = visitor(server, seeded[0])
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
