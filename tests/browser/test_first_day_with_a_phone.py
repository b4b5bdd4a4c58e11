"""A clinic's first day without a laboratory: from the first sign-in to a recording that walks."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, FilePayload, Page, expect

from rehab.stations.https.certificate import network_address
from tests.support.browsers import PATIENCE_MS, SIZES, Visit, picture, sign_in
from tests.support.data import signals
from tests.support.layout import set_screen
from tests.support.servers import Server, free_port, serve
from tests.support.walk_seed import make_walks
from tests.support.worn_phone import read_steps

pytestmark = [pytest.mark.browser, pytest.mark.server]

# Taps of twelve. Scanning a QR code is one, choosing a file two; those in a device's own settings,
# where it installs the certificate, are not ours (docs/using.md).
MOST_HERE, MOST_OWN, MINUTES = 7, 12, 5


@pytest.fixture
def new_clinic(tmp_path) -> Iterator[Server]:
    """Return a server as `make run` starts it on a new machine."""
    if network_address() is None:
        pytest.skip("this machine has no network")
    with serve(
        tmp_path, new_machine=True, settings={"GARRY_HTTPS_PORT": str(free_port())}
    ) as server:
        yield server


class FirstDay:
    """The therapist's own screen on a clinic's first day, and how often anybody has tapped."""

    def __init__(self, browser: Browser, server: Server) -> None:
        self.browser, self.taps, self._begin_s = browser, ["sign in"], time.monotonic()
        self.pt = self.open("laptop", server.url)
        self.pt.goto("/start/")
        sign_in(self.pt, server.password)
        picture(self.pt, "start")
        self.tap(self.pt, "main >> text=Try a phone")

    def open(self, size: str, url: str = "", *, trusts: bool = True) -> Page:
        """Return a screen of that size; whether it has the clinic's own certificate."""
        width, height = SIZES[size]
        context = self.browser.new_context(
            base_url=url or None,
            viewport={"width": width, "height": height},
            ignore_https_errors=trusts,
        )
        context.set_default_timeout(PATIENCE_MS)
        return context.new_page()

    def tap(self, page: Page, what: str) -> None:
        """Tap what a page shows."""
        self.taps.append(what)
        page.click(what)

    def let_in(self, size: str, step: str) -> Page:
        """Let a device of ours in, by QR code, certificate and its own code."""
        expect(self.pt.locator(f"[data-step={step}] [aria-current]")).to_be_visible()
        there = self.pt.locator(".address").first.inner_text()
        self.taps.append(f"scan with the {size}")
        new = self.open(size, trusts=False)
        new.wait_for_timeout(1500)  # until the server listens, less than a scan takes
        new.goto(there)
        picture(new, f"{size}-certificate")
        with new.expect_download():
            self.tap(new, "text=1. Download the certificate")
        expect(new.locator("[data-goes-on]")).to_be_visible()  # it is not trusted yet
        new.context.close()
        page = self.open(size)  # now it is: the same page goes on by itself
        page.goto(there)
        code = page.locator(".code")
        expect(code).to_be_visible()
        assert page.url.startswith("https://")
        picture(page, f"{size}-code")
        self.pt.locator("[name=code]").press_sequentially(code.inner_text())
        expect(self.pt.get_by_text("It shows this code")).to_be_visible()  # asked for by itself
        picture(self.pt, f"let-the-{size}-in")
        self.tap(self.pt, "text=It shows this code")
        return page

    def open_here(self, what: str) -> Page:
        """Open a screen in a window beside the therapist's."""
        with self.pt.expect_popup() as opened:
            self.tap(self.pt, what)
        return opened.value

    def walk(self, phone: Page, tablet: Page) -> None:
        """Choose a leg's recording, start, and see it walk to the patient's goal."""
        choose = phone.locator("[data-recording]")
        expect(phone.locator("section[data-step=trial]")).to_be_visible()
        expect(self.pt.locator("main h2")).to_have_text("On the phone’s page: choose a recording")
        picture(self.pt, "choose-a-recording")
        choose.set_input_files({"name": "a.csv", "mimeType": "text/csv", "buffer": b"a,b\n1,2\n"})
        expect(phone.locator("[data-show=problem]")).to_contain_text("seven columns")
        choose.set_input_files(signals("stroke_imu") / "pp02_001_leftshank.csv.gz")
        self.taps += ["choose a recording", "this one"]
        playing = phone.locator("[data-show=playing]")
        expect(playing).to_have_text("It walks as soon as the therapist starts the session.")
        picture(phone, "phone-recording")
        start = self.pt.locator("[name=start]")
        expect(start).to_be_visible()
        expect(phone.locator("[data-show=strides]")).to_have_text("0")
        picture(self.pt, "start-the-session")
        self.tap(self.pt, "[name=start]")
        source = self.pt.locator("[data-presence=source]")
        expect(source).to_contain_text("recording")
        expect(self.pt.locator(".whom")).not_to_contain_text("simulated")
        expect(playing).to_contain_text("without its first 20 s")
        coach = self.pt.locator("[data-show=coach]")
        expect(coach).to_contain_text("Goal at the end of the baseline", timeout=PATIENCE_MS)
        body = tablet.locator("body")
        expect(body).to_have_attribute("data-step", "16", timeout=PATIENCE_MS)
        expect(body).to_have_attribute("data-look", "feedback", timeout=PATIENCE_MS)
        # A share of stance varies by a hundredth: its scale begins above 0, and says so.
        expect(tablet.locator(".cut")).to_be_visible()
        set_screen(tablet, "tablet-portrait")  # where there is room for the chart
        heights = tablet.eval_on_selector_all(
            ".dots circle:not(.gap)", "all => all.map((one) => Number(one.getAttribute('cy')))"
        )
        assert max(heights) - min(heights) >= 10  # of 585
        expect(self.pt.locator("#strip")).to_contain_text("110 %")
        for page, name in ((phone, "phone-playing"), (tablet, "tablet"), (self.pt, "therapist")):
            picture(page, f"{name}-walking")

    def check(self, most: int) -> None:
        """Fail where that took too many taps, or too long."""
        needed_s = time.monotonic() - self._begin_s
        print(f"\n{len(self.taps)} taps, {needed_s:.0f} s: {', '.join(self.taps)}")
        assert len(self.taps) <= most
        assert needed_s <= 60 * MINUTES


def test_from_the_first_start_to_a_leg_that_walks(new_clinic: Server, browser: Browser):
    """In windows of one computer."""
    day = FirstDay(browser, new_clinic)
    picture(day.pt, "try-a-phone")
    tablet = day.open_here("text=Open the patient’s screen here")
    phone = day.open_here("text=Open the phone’s page here")
    day.walk(phone, tablet)
    day.check(MOST_HERE)
    day.pt.click("[data-robot=stop]")  # of a robot that nobody has
    expect(day.pt.locator("[data-show=no-robot]")).to_have_text("No robot here")
    expect(day.pt.locator("[data-robot=arm]")).to_be_hidden()
    expect(day.pt.locator("[data-show=robot-why]")).to_have_text("")
    steps = read_steps(new_clinic, 1)
    assert len(steps) >= 12
    assert all(is_valid for is_valid, _ in steps)


def test_the_same_on_a_tablet_and_a_phone_of_ones_own(new_clinic: Server, browser: Browser):
    day = FirstDay(browser, new_clinic)
    day.tap(day.pt, "text=Let phones and tablets in")
    picture(day.pt, "scan-with-the-tablet")
    tablet = day.let_in("tablet-landscape", "screen")
    expect(tablet.locator("body")).to_have_attribute("data-look", "ready")
    expect(day.pt.locator("[data-live=screen]")).to_have_text("A screen shows Demo")
    picture(day.pt, "scan-with-the-phone")
    phone = day.let_in("phone", "phone")
    day.walk(phone, tablet)
    day.check(MOST_OWN)
    assert all(is_valid for is_valid, _ in read_steps(new_clinic, 1))


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
        page.set_input_files("[data-recording]", file)
        playing = page.locator("[data-show=playing]")
        expect(playing).to_have_text("It walks as soon as the therapist starts the session.")
        pt.click("[data-main]")
        expect(playing).to_contain_text("Recording, 0:00 of 0:02")
        expect(playing).to_contain_text("Recording again, round 2")
        expect(pt.locator("[data-presence=source]")).to_contain_text("recording, round")
        pt.click("[data-end]")
        pt.click("text=End session")
        expect(playing).to_contain_text("The session has ended.")
