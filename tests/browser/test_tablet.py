"""A tablet of its own: paired once, it follows its station through a session and to the scores."""

from __future__ import annotations

import time

import pytest
from playwright.sync_api import Browser, expect

from tests.support.browsers import PATIENCE_MS, Visit, go_on_to_scores
from tests.support.layout import set_screen
from tests.support.servers import Server

pytestmark = pytest.mark.browser


@pytest.mark.realtime
def test_a_paired_tablet_follows_its_station(server: Server, browser: Browser, visit: Visit):
    with browser.new_context(base_url=server.url) as alone:
        alone.set_default_timeout(PATIENCE_MS)
        pt, tablet = visit("/start/", size="laptop"), alone.new_page()
        set_screen(tablet, "tablet-portrait")
        tablet.goto("/tablet/")
        pt.click("text=Stations")
        pt.eval_on_selector("details:has-text('Add a device')", "one => (one.open = true)")
        pt.click("text=Pair a tablet")
        pt.fill("#code", tablet.inner_text(".code").lower())
        pt.click("text=It shows this code")
        expect(pt.locator(".notes")).to_contain_text("belongs to Station 1")
        expect(tablet.locator("h1")).to_have_text("Ready.", timeout=PATIENCE_MS)

        notes, patients = (pt.locator(one).bounding_box() for one in (".notes li", ".list"))
        assert patients["y"] == pytest.approx(notes["y"] + notes["height"], abs=1)  # no gap
        pt.get_by_role("button", name="Try a demo").click()
        pt.click("text=Change something")
        pt.click("[name=then][value=monitor]")
        tablet.wait_for_selector("body[data-look=ready]")
        expect(tablet.locator("header b")).to_have_text("Demo")
        assert not tablet.is_visible("[data-change=start]")  # that is the therapist's
        pt.click("[data-main]")
        tablet.wait_for_function("() => document.body.dataset.step >= 2")
        expect(pt.locator("[data-presence=tablets]")).to_contain_text("connected")
        tablet.click("[data-change=pause]")  # whoever walks may always rest
        tablet.wait_for_selector("body[data-look=paused]")
        assert not tablet.is_visible("[data-change=resume]")
        expect(pt.locator("[data-main]")).to_contain_text("Resume")
        pt.click("[data-end]")
        pt.click("text=End session")
        go_on_to_scores(tablet)
        expect(tablet.locator(".you >> visible=true")).to_be_in_viewport()

        pt.goto("/start/")  # somebody else is next, while these scores are still shown
        pt.click("text=Try a demo")
        pt.click("text=Change something")
        pt.click("[name=then][value=monitor]")
        pt.wait_for_selector("[data-main]:not([disabled])")
        asked_at = time.monotonic()
        tablet.wait_for_selector("body[data-look=ready]")
        assert time.monotonic() - asked_at <= 2
        expect(pt.locator(".readiness")).to_contain_text("✓ A screen shows Demo")
        pt.click("[data-end]")
        pt.click("text=End session")
        go_on_to_scores(tablet)
        tablet.click(".go")
        expect(tablet.locator("h1")).to_have_text("Ready.", timeout=PATIENCE_MS)
