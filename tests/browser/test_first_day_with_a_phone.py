"""A clinic's first day without a laboratory: from the first sign-in to a recording that walks."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, FilePayload, Page, expect

from rehab.stations.https.certificate import network_address
from tests.support.browsers import PATIENCE_MS, SIZES, Visit, picture, sign_in
from tests.support.data import signals
from tests.support.servers import Server, free_port, serve
from tests.support.walk_seed import make_walks
from tests.support.worn_phone import read_steps

pytestmark = [pytest.mark.browser, pytest.mark.server]

TAPS, MINUTES = 10, 5  # of twelve: who is new to it takes a wrong turn


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

    tablet = open_screen(browser, address, "tablet-landscape")
    tablet.goto("/")
    picture(tablet, "tablet-front-page")
    tap(tablet, "text=This is the patient’s tablet", "the patient's tablet")
    pt = open_screen(browser, server.url, "laptop")
    pt.goto("/start/")
    sign_in(pt, server.password)
    taps.append("sign in")
    picture(pt, "start")
    tap(pt, "main >> text=Try a phone", "try a phone")
    expect(pt.locator("main")).to_contain_text(f"{address}/tablet/")
    picture(pt, "try-a-phone")
    pt.fill("[name=code]", tablet.locator(".code").inner_text().replace(" ", ""))
    tap(pt, "text=Compare the code", "compare")
    picture(pt, "let-the-tablet-in")
    tap(pt, "text=It shows this code", "let in")
    expect(pt.locator("[data-live=screen]")).to_have_text("A screen shows Demo")

    with pt.expect_popup() as opened:
        tap(pt, "text=Open the phone’s page", "the phone's page")
    phone = opened.value
    phone.set_viewport_size({"width": SIZES["phone"][0], "height": SIZES["phone"][1]})
    expect(phone.locator("section[data-step=trial]")).to_be_visible()
    connected = pt.locator("[data-live=phone]")
    expect(connected).to_have_text("The phone’s page is connected. Play a recording there.")
    recording = phone.locator("[data-recording]")
    recording.set_input_files({"name": "a.csv", "mimeType": "text/csv", "buffer": b"a,b\n1,2\n"})
    expect(phone.locator("[data-show=problem]")).to_contain_text("seven columns")
    expect(phone.locator("[data-play=recording]")).to_be_hidden()
    recording.set_input_files(leg)
    taps.append("choose a recording")
    picture(phone, "phone-recording")
    tap(phone, "text=Play this recording", "play")
    expect(phone.locator("[data-show=playing]")).to_contain_text("Recording, 0:2")
    expect(connected).to_have_text("The phone’s page is connected.")
    tap(pt, "text=To the therapist’s page", "the therapist's page")
    source = pt.locator("[data-presence=source]")
    expect(source).to_contain_text("recording · connected")
    expect(pt.locator(".readiness")).to_contain_text("✓ A screen shows Demo✓ Sensor")
    expect(pt.locator("[data-show=extras]")).to_contain_text("More is better")
    expect(pt.locator(".whom")).not_to_contain_text("simulated")
    picture(pt, "therapist-before-the-start")
    tap(pt, "[data-main]", "start")
    coach = pt.locator("[data-show=coach]")
    expect(coach).to_contain_text("Goal at the end of the baseline", timeout=PATIENCE_MS)

    expect(tablet.locator("body")).to_have_attribute("data-step", "12", timeout=PATIENCE_MS)
    expect(tablet.locator("body")).to_have_attribute("data-look", "feedback", timeout=PATIENCE_MS)
    picture(phone, "phone-playing")
    picture(tablet, "tablet-walking")
    picture(pt, "therapist-walking")
    needed_s = time.monotonic() - begin_s
    print(f"\n{len(taps)} taps, {needed_s:.0f} s: {', '.join(taps)}")
    assert len(taps) <= TAPS
    assert needed_s <= 60 * MINUTES
    expect(source).to_contain_text("clock")
    steps = read_steps(server, 1)
    assert len(steps) >= 12
    assert all(is_valid for is_valid, _ in steps)


def test_a_recording_says_its_round_and_ends_with_the_session(
    server: Server, browser: Browser, visit: Visit
):
    (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0})
    rows = [f"{n / 50},0,0,9.81,{n % 7},0,0" for n in range(100)]
    with browser.new_context(base_url=server.url) as pocket:
        page = pocket.new_page()
        page.goto(f"/sensor/?trial#token={walk.source}&place=shank&side=left")
        text = "\n".join(["time_s,ax,ay,az,gx,gy,gz", *rows]).encode()
        expect(page.locator("section[data-step=trial]")).to_be_visible()
        file: FilePayload = {"name": "short.csv", "mimeType": "text/csv", "buffer": text}
        pt = visit(walk.monitor_path, walk, "laptop")
        pt.click("[data-main]")
        page.set_input_files("[data-recording]", file)
        page.click("text=Play this recording")
        playing = page.locator("[data-show=playing]")
        expect(playing).to_contain_text("Recording, 0:00 of 0:02")
        expect(playing).to_contain_text("Recording again, round 2")
        expect(pt.locator("[data-presence=source]")).to_contain_text("recording, round")
        pt.click("[data-end]")
        pt.click("text=End session")
        expect(playing).to_contain_text("The session has ended.")
