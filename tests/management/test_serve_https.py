"""A server that encrypts by itself, as real TLS clients and a browser in the network see it."""

from __future__ import annotations

import base64
import hashlib
import json
import shutil
import ssl
import urllib.request
from collections.abc import Iterator
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from playwright.sync_api import sync_playwright
from websockets.sync.client import connect

from rehab.stations.https.authority import read_certificate
from rehab.stations.https.certificate import network_address
from tests.support.servers import Server, free_port, serve, try_python
from tests.support.walk_seed import Feet, make_walks

pytestmark = pytest.mark.server


@pytest.fixture(scope="module")
def encrypting(tmp_path_factory) -> Iterator[tuple[Server, str, ssl.SSLContext]]:
    """Return a server, where others reach it by https, and what trusts its authority."""
    address, port = network_address(), free_port()
    if address is None:
        pytest.skip("this machine has no network")
    folder = tmp_path_factory.mktemp("https")
    with serve(
        folder, "--https", new_machine=True, settings={"GARRY_HTTPS_PORT": str(port)}
    ) as server:
        trust = ssl.create_default_context(cafile=folder / "https" / "authority.pem")
        yield server, f"{address}:{port}", trust


def open_as(
    browser: CookieJar, trust: ssl.SSLContext, url: str, form: dict[str, str] | None = None
):
    opener = urllib.request.build_opener(
        urllib.request.ProxyHandler({}),
        urllib.request.HTTPSHandler(context=trust),
        urllib.request.HTTPCookieProcessor(browser),
    )
    request = urllib.request.Request(url, headers={"Referer": url})  # noqa: S310 (our own server)
    if form is not None:
        token = next(one.value for one in browser if one.name == "csrftoken")
        request.data = urlencode(form | {"csrfmiddlewaretoken": token}).encode()
    return opener.open(request, timeout=20)


def test_people_sign_in_and_cookies_never_leave_https(encrypting):
    server, address, trust = encrypting
    assert f"Phones and tablets: https://{address}/" in server.said
    browser = CookieJar()
    url = f"https://{address}/sign-in/"
    open_as(browser, trust, url)
    page = open_as(browser, trust, url, {"username": "pt", "password": server.password})
    assert "/sign-in/" not in page.url
    assert {one.name for one in browser} >= {"sessionid", "csrftoken"}
    assert all(one.secure for one in browser)
    assert "Strict-Transport-Security" not in page.headers
    plain = open_as(CookieJar(), trust, f"http://{address}/start/")
    assert plain.url.startswith(f"https://{address}/sign-in/")
    assert b"GARRY" in open_as(CookieJar(), trust, f"http://{address}/certificate/").read()


def test_who_does_not_trust_it_gets_nothing(encrypting):
    _, address, _ = encrypting
    with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
        open_as(CookieJar(), ssl.create_default_context(), f"https://{address}/sign-in/")


def test_sources_walk_by_wss(encrypting):
    server, address, trust = encrypting
    (walk,) = make_walks(server, {})
    url = f"wss://{address}/ws/source/"
    headers = {"Authorization": f"Bearer {walk.source}"}
    origin: Any = f"https://{address}"
    page = f"wss://{address}/ws/session/{walk.session}/monitor/"
    cookie = {"Cookie": f"sessionid={walk.cookie}"}
    with connect(url, ssl=trust, additional_headers=headers, proxy=None) as socket:
        feet = Feet(socket, {})
        assert feet.number == 0
        with connect(
            page, ssl=trust, additional_headers=cookie, origin=origin, proxy=None
        ) as pages:
            assert json.loads(pages.recv(timeout=10))["type"] == "snapshot"
            pages.send(json.dumps({"type": "change", "kind": "start", "value": None, "id": "a"}))
            feet.hear("start")
            feet.walk(*[1.1] * 40)  # in one frame, and as many events come back
            heard = ""
            while '"number":40' not in heard.replace(" ", ""):
                heard = str(pages.recv(timeout=10))


def test_a_browser_measures_movement_there(encrypting):
    server, address, _ = encrypting
    key = read_certificate(server.folder / "https" / "server.pem").public_key()
    spki = key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
    digest = base64.b64encode(hashlib.sha256(spki).digest()).decode()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", f"--ignore-certificate-errors-spki-list={digest}"],
        )
        page = browser.new_page()
        page.goto(f"http://{address}/sensor/#token=x&place=shank&side=left")
        page.wait_for_url("https://**/sensor/*token*")  # once this is trusted, by itself
        assert page.evaluate("isSecureContext && 'DeviceMotionEvent' in window")
        assert page.locator("[data-begin]").is_visible()
        browser.close()


@pytest.mark.parametrize(
    ("files", "cure"),
    [
        ({"GARRY_CERTIFICATE": "missing.pem"}, "is no file"),
        ({"GARRY_CERTIFICATE": __file__}, "readable PEM files"),
    ],
)
def test_files_that_cannot_encrypt_stop_the_start(tmp_path: Path, files, cure):
    port = free_port()
    done = try_python(tmp_path, "manage.py", "serve", port=port, **files)
    assert done.returncode == 1
    assert cure in done.stderr
