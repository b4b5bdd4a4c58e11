"""A clinic's first day without a laboratory: from the first sign-in to a recording that walks."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from rehab.stations.https.certificate import network_address
from tests.support.browsers import PATIENCE_MS, SIZES, picture, sign_in
from tests.support.data import signals
from tests.support.servers import Server, free_port, serve
from tests.support.worn_phone import read_steps

pytestmark = [pytest.mark.browser, pytest.mark.server]

TAPS, MINUTES = 12, 5


@pytest.fixture
def new_clinic(tmp_path) -> Iterator[tuple[Server, str]]:
    """Return a server on a new machine, and where others in its network reach it."""
    address, port = network_address(), free_port()
    if address is None:
        pytest.skip("this machine has no network")
    settings = {"GARRY_HTTPS_PORT": str(port)}
    with serve(tmp_path, "--https", new_machine=True, settings=settings) as server:
        yield server, f"https://{address}:{port}"


def open_screen(browser: Browser, url: str, size: str) -> Page:
    """Return a screen of that size, whose person trusts the clinic's own certificate."""
    width, height = SIZES[size]
    context = browser.new_context(
        base_url=url, viewport={"width": width, "height": height}, ignore_https_errors=True
    )
    context.set_default_timeout(PATIENCE_MS)
    return context.new_page()


def test_from_the_first_start_to_a_leg_that_walks(new_clinic, browser: Browser):
    server, address = new_clinic
    leg = signals("stroke_imu") / "pp02_001_leftshank.csv.gz"
    begin_s, taps = time.monotonic(), []

    def tap(page: Page, what: str, name: str) -> None:
        taps.append(name)
        page.click(what)

    pt = open_screen(browser, server.url, "laptop")
    pt.goto("/start/")
    sign_in(pt, server.password)
    taps.append("sign in")
    tap(pt, "text=First steps, one by one", "first steps")
    picture(pt, "first-steps")
    expect(pt.locator("main")).to_contain_text(f"{address}/tablet/")
    tablet = open_screen(browser, address, "tablet-landscape")
    tablet.goto("/tablet/")
    pt.fill("[name=code]", tablet.locator(".code").inner_text().replace(" ", ""))
    tap(pt, "text=Compare the code", "compare")
    picture(pt, "let-the-tablet-in")
    tap(pt, "text=It shows this code", "let in")
    tap(pt, "[data-step=sensor] a", "the step Sensor")
    picture(pt, "first-steps-sensor")
    tap(pt, "text=Try a phone", "try a phone")
    picture(pt, "try-a-phone")

    with pt.expect_popup() as opened:
        tap(pt, "text=Open the phone’s page", "the phone's page")
    phone = opened.value
    phone.set_viewport_size({"width": SIZES["phone"][0], "height": SIZES["phone"][1]})
    phone.wait_for_selector("[data-begin]:enabled")
    picture(phone, "phone-strap")
    phone.set_input_files("[data-recording]", leg)
    taps.append("choose a recording")
    tap(phone, "[data-begin]", "begin")
    expect(phone.locator("[data-check=still]")).to_be_visible()
    picture(phone, "phone-check")
    tap(pt, "text=To the therapist’s page", "the therapist's page")
    expect(phone.locator("[data-show=verdict]")).to_have_text("Good.", timeout=PATIENCE_MS)
    picture(phone, "phone-good")
    tap(phone, "[data-lock]", "lock")
    expect(pt.locator("[data-presence=source]")).to_contain_text("connected")
    tap(pt, "[data-main]", "start")

    expect(tablet.locator("body")).to_have_attribute("data-step", "6", timeout=PATIENCE_MS)
    picture(phone, "phone-locked")
    picture(tablet, "tablet-walking")
    picture(pt, "therapist-walking")
    needed_s = time.monotonic() - begin_s
    print(f"\n{len(taps)} taps, {needed_s:.0f} s: {', '.join(taps)}")
    assert len(taps) <= TAPS
    assert needed_s <= 60 * MINUTES
    expect(pt.locator("[data-presence=source]")).to_contain_text("clock")
    steps = read_steps(server, 1)
    assert len(steps) >= 6
    assert all(is_valid for is_valid, _ in steps)
