"""Signing in with a second factor in a real browser: codes of an app, and a passkey."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from rehab.people.sign_in.factors.totp import TIME_STEP_S, generate_code
from tests.support.browsers import SIZES
from tests.support.servers import Server, serve

pytestmark = pytest.mark.browser


@pytest.fixture
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serve(tmp_path_factory.mktemp("data")) as running:
        yield running


@pytest.fixture
def page(browser: Browser, server: Server) -> Iterator[Page]:
    width, height = SIZES["phone"]
    # By name: browsers have no passkeys for an address of numbers.
    with browser.new_context(
        base_url=f"http://localhost:{server.port}",
        viewport={"width": width, "height": height},
        has_touch=True,
    ) as context:
        made = context.new_page()
        complaints: list[str] = []
        made.on(
            "console", lambda said: complaints.append(said.text) if said.type == "error" else None
        )
        yield made
    assert complaints == []


def sign_in(page: Page, server: Server) -> None:
    expect(page.locator("#id_username")).to_be_focused()
    page.keyboard.type("pt")
    page.fill("#id_password", server.password)
    page.tap("[type=submit]")


def sign_out(page: Page) -> None:
    page.goto("/account/")  # on a phone it is only there
    page.tap("main >> text=Sign out")
    expect(page.locator(".notes")).to_contain_text("You are signed out.")


def fresh_code(secret: str, after: str = "") -> str:
    """Return a code that was not used yet, waiting for it where need be."""
    while (code := generate_code(secret, int(time.time()) // TIME_STEP_S)) == after:
        time.sleep(0.5)
    return code


def set_up_app(page: Page) -> tuple[str, str, list[str]]:
    """Read the secret, type the code, read the recovery codes."""
    secret = page.inner_text(".secret").replace(" ", "")
    code = fresh_code(secret)
    page.fill("#id_code", code)
    page.tap("[type=submit]")
    expect(page.locator("h1")).to_have_text("Keep these codes")
    kept = page.locator(".codes code").all_inner_texts()
    page.tap("text=I have them")
    return secret, code, kept


@pytest.mark.essential
def test_an_app_and_its_recovery_codes(page: Page, server: Server) -> None:
    page.goto("/account/")
    sign_in(page, server)
    expect(page.locator("h1")).to_have_text("Your account")
    page.tap("a:has-text('Authenticator app')")
    secret, used, recovery_codes = set_up_app(page)
    expect(page.locator(".kept")).to_contain_text("Authenticator app")

    sign_out(page)
    page.goto("/patients/new/")
    sign_in(page, server)
    expect(page.locator("#id_code")).to_be_focused()
    page.keyboard.type(used)
    page.tap("[type=submit]")
    expect(page.locator(".errorlist")).to_contain_text("or has been used")
    page.fill("#id_code", fresh_code(secret, used))
    page.tap("[type=submit]")
    expect(page).to_have_url(f"http://localhost:{server.port}/patients/new/")

    sign_out(page)
    sign_in(page, server)
    page.fill("#id_code", recovery_codes[0])
    page.tap("[type=submit]")
    expect(page.locator("h1").first).to_contain_text("Today")


def test_a_passkey(page: Page, server: Server) -> None:
    devices = page.context.new_cdp_session(page)
    devices.send("WebAuthn.enable")
    device = devices.send(
        "WebAuthn.addVirtualAuthenticator",
        {
            "options": {
                "protocol": "ctap2",
                "transport": "internal",
                "hasUserVerification": True,
                "isUserVerified": True,
                "automaticPresenceSimulation": True,
            }
        },
    )["authenticatorId"]
    page.goto("/account/")
    sign_in(page, server)
    page.tap("a:has-text('Passkey')")
    page.fill("#name", "Laptop")
    page.tap("text=Create a passkey")
    expect(page.locator("h1")).to_have_text("Keep these codes")
    page.tap("text=I have them")
    expect(page.locator(".kept")).to_contain_text("Laptop")

    page.tap("a:has-text('Passkey')")
    page.tap("text=Create a passkey")
    expect(page.locator("[data-say]")).to_contain_text("already has a passkey")
    page.goto("/account/")

    sign_out(page)
    page.goto("/account/")
    sign_in(page, server)
    expect(page.locator("h1")).to_have_text("Is it you?")
    page.tap("text=Use a passkey")
    expect(page.locator("h1")).to_have_text("Your account")

    sign_out(page)
    devices.send("WebAuthn.setUserVerified", {"authenticatorId": device, "isUserVerified": True})
    devices.send("WebAuthn.clearCredentials", {"authenticatorId": device})  # the device is lost
    sign_in(page, server)
    page.tap("text=Use a passkey")
    expect(page.locator("[data-say]")).to_contain_text("No passkey was given")
