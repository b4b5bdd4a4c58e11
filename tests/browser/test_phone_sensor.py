"""A phone on a shin: from the square that it scans to strides, whatever happens to it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect
from scipy.spatial.transform import Rotation

from tests.support.browsers import PATIENCE_MS, Visit
from tests.support.servers import Server
from tests.support.simulated_leg import Floats
from tests.support.walk_seed import Walk, make_walks
from tests.support.worn_phone import Change, WornPhone, read_steps

pytestmark = pytest.mark.browser


@contextmanager
def checking(
    browser: Browser, server: Server, walk: Walk, script: str | None = None
) -> Iterator[Page]:
    """Open the page of a phone on the left shin, begun: it checks. A script runs before it."""
    with browser.new_context(base_url=server.url) as pocket:
        pocket.set_default_timeout(PATIENCE_MS)
        if script is not None:
            pocket.add_init_script(script)
        page = pocket.new_page()
        page.goto(f"/sensor/#token={walk.source}&place=shank&side=left")
        assert walk.source not in page.url  # it leaves the address at once
        page.click("[data-begin]")
        page.wait_for_selector("body[data-step=check]")
        yield page


@pytest.mark.essential
def test_a_worn_phone_loses_no_stride(server: Server, browser: Browser, visit: Visit):
    (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0})
    pt = visit(walk.monitor_path, walk, size="laptop")
    with checking(browser, server, walk) as page:
        phone = WornPhone(page, 360)
        phone.walk(0, 4)
        expect(page.locator("[data-check=still]")).to_have_class("done")
        pt.click("[data-main]")  # the session starts
        expect(pt.locator("[data-presence=source]")).to_contain_text("connected")
        phone.walk(4, 24)
        expect(page.locator("[data-check=walk]")).to_have_class("done")
        expect(page.locator("[data-show=verdict]")).to_have_text("Good.")
        page.click("[data-lock]")
        expect(page.locator("[data-show=state]")).to_contain_text("0 waiting")
        assert phone.strides >= 14

        page.context.set_offline(True)  # strides wait on the phone, also through a reload
        phone.walk(24, 300)
        before = phone.strides
        expect(page.locator("[data-show=state]")).to_contain_text("no network", timeout=PATIENCE_MS)
        assert len(read_steps(server, walk.session)) < before - 200
        page.context.set_offline(False)
        page.reload()
        page.click("[data-begin]")
        page.wait_for_selector("body[data-step=check]")
        phone.walk(300, 324)
        page.locator("[data-lock]").dispatch_event("click")
        expect(page.locator("[data-show=state]")).to_contain_text("0 waiting")
        expect(page.locator("[data-show=state]")).to_contain_text("connected")
        after = phone.strides
        assert before >= 240  # more than one frame takes
        assert after >= 18
        stored = read_steps(server, walk.session)
        assert len(stored) == before + after
        assert all(is_valid for is_valid, _ in stored)
        assert {"shank_stance_percent", "wearable_shank"} <= json.loads(stored[0][1]).keys()
        expect(pt.locator("[data-presence=source]")).to_contain_text("valid")

        page.evaluate("""() => {
          Object.defineProperty(document, "hidden", { get: () => true });
          document.dispatchEvent(new Event("visibilitychange"));
        }""")
        presence = pt.locator("[data-presence=source]")
        expect(presence).to_contain_text("the phone is showing another page")
        expect(presence).to_have_class(re.compile(r"\blow\b"))
        phone.walk(324, 332)
        hidden = phone.strides - after
        expect(page.locator("[data-show=state]")).to_contain_text("0 waiting")
        later = read_steps(server, walk.session)[len(stored) :]
        assert len(later) == hidden > 4
        assert not any(is_valid for is_valid, _ in later)  # and so none is a missed goal


def test_good_is_said_only_of_what_was_checked(server: Server, browser: Browser):
    (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0})
    with checking(browser, server, walk) as page:
        verdict = page.locator("[data-show=verdict]")
        phone = WornPhone(page, 40)
        phone.walk(4, 20)  # nobody stood still before
        expect(page.locator("[data-check=walk]")).to_have_class("done")
        expect(page.locator("[data-check=still]")).to_have_class("now")
        expect(verdict).to_have_text(
            "Not checked yet: stand still for three seconds, then walk on."
        )
        phone.walk(20, 24.5, lambda part: part * (1, *6 * [0]) + (0, 0, 0, 9.81, 0, 0, 0))
        phone.walk(24.5, 32)
        expect(verdict).to_have_text("Good.")


def slip(part: Floats) -> Floats:
    """Turn a phone by 25° on its leg."""
    matrix = np.eye(7)
    matrix[1:4, 1:4] = matrix[4:, 4:] = Rotation.from_euler(
        "xz", (25, 10), degrees=True
    ).as_matrix()
    return part @ matrix.T


LOW_BATTERY = "navigator.getBattery = async () => ({ charging: false, level: 0.1 })"
# What happens to a phone after 20 s, what the therapist reads, and how many strides may count until
# then; None where all do.
TROUBLES: dict[str, tuple[Change, str, int | None]] = {
    "slow": (lambda part: part[np.arange(len(part)) % 3 > 0], "too slowly", 2),
    "gap": (lambda part: part[abs(part[:, 0] - 21) > 0.25], "missed samples", 1),
    "slip": (slip, "has moved", 5),
    "battery": (lambda part: part, "battery is low", None),
}


@pytest.mark.long
@pytest.mark.parametrize("name", TROUBLES)
def test_what_is_wrong_with_a_phone_is_told_and_marks_no_miss(
    name: str, server: Server, browser: Browser, visit: Visit
):
    change, words, late = TROUBLES[name]
    (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0})
    pt = visit(walk.monitor_path, walk, size="laptop")
    script = LOW_BATTERY if name == "battery" else None
    with checking(browser, server, walk, script) as page:
        pt.click("[data-main]")
        expect(pt.locator("[data-presence=source]")).to_contain_text("connected")
        phone = WornPhone(page, 40)
        phone.walk(0, 20)
        before = phone.strides
        phone.walk(20, 40, change)
        expect(pt.locator("[data-presence=source]")).to_contain_text(words)
        page.locator("[data-lock]").dispatch_event("click")
        expect(page.locator("[data-show=state]")).to_contain_text("0 waiting")
        assert phone.strides > before + 4
        valid = [is_valid for is_valid, _ in read_steps(server, walk.session)]
    assert all(valid[:before])
    assert all(valid) if late is None else not any(valid[before + late :])


@pytest.mark.long
def test_a_phone_that_is_strapped_on_otherwise_is_told(
    server: Server, browser: Browser, visit: Visit
):
    (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0})
    pt = visit(walk.monitor_path, walk, size="laptop")
    with checking(browser, server, walk) as page:
        phone = WornPhone(page, 40)
        phone.walk(0, 9.5)  # how it stood is known once it is known how a leg swings
        page.click("[data-lock]")
        page.reload()
        page.click("[data-begin]")
        page.wait_for_selector("body[data-step=check]")
        phone.walk(0, 9.5, lambda part: slip(part) + np.eye(7)[0] * 20)  # seconds later
        expect(page.locator("[data-show=verdict]")).to_contain_text("compared with last time")
        expect(page.locator("[data-show=verdict]")).to_have_attribute("data-sign", "amber")
        expect(pt.locator("[data-presence=source]")).to_contain_text("differently from last time")
        page.click("[data-lock]")  # the therapist takes it as it is
        expect(pt.locator("[data-presence=source]")).not_to_contain_text("differently")


@pytest.mark.essential
def test_it_says_why_it_cannot_measure(server: Server, browser: Browser):
    with browser.new_context(base_url=server.url) as pocket:
        page = pocket.new_page()
        page.goto("/sensor/")
        expect(page.locator("[data-show=refusal]")).to_contain_text("Scan the QR code")
        page = pocket.new_page()
        page.add_init_script("Object.defineProperty(window, 'isSecureContext', { value: false })")
        page.goto("/sensor/#token=x&place=shank&side=left")
        expect(page.locator("[data-show=refusal]")).to_contain_text("https")


@pytest.mark.essential
def test_a_therapist_is_led_to_https_before_a_phone_is_paired(visit: Visit):
    page = visit("/stations/", size="laptop")
    page.eval_on_selector("details:has-text('Add a device')", "one => (one.open = true)")
    page.click("text=Pair a phone")
    expect(page.locator("main")).to_contain_text("secure address")
    expect(page.locator("[name=side]")).to_have_count(0)
    page.click("a:text-is('Set up https')")
    expect(page.locator("h1")).to_contain_text("by https")
