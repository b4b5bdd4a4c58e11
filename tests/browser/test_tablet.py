"""A tablet of its own: paired once, it follows its station through a session and to the scores."""

from __future__ import annotations

import time

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import SIZES, go_on_to_scores, sign_in
from tests.support.servers import serve

pytestmark = pytest.mark.browser

PATIENCE_MS = 40_000


@pytest.mark.realtime
def test_a_paired_tablet_follows_its_station(tmp_path, browser: Browser):
    with serve(tmp_path) as server:

        def open_page(size: str) -> Page:
            width, height = SIZES[size]
            context = browser.new_context(
                base_url=server.url, viewport={"width": width, "height": height}
            )
            context.set_default_timeout(PATIENCE_MS)
            return context.new_page()

        pt, tablet = open_page("laptop"), open_page("tablet-portrait")
        tablet.goto("/tablet/")
        pt.goto("/start/")
        sign_in(pt, server.password)
        pt.click("text=Tablets")
        pt.fill("#code", tablet.inner_text(".code").lower())
        pt.click("text=Let it in")
        expect(pt.locator(".notes")).to_contain_text("belongs to Station 1")
        expect(tablet.locator("h1")).to_have_text("Ready.", timeout=PATIENCE_MS)

        pt.click("text=Try a demo")
        pt.click("text=Change something")
        pt.click("text=To the therapist")
        tablet.wait_for_selector("body[data-look=ready]")
        expect(tablet.locator("header b")).to_have_text("Demo")
        assert not tablet.is_visible("[data-change=start]")  # that is the therapist's
        pt.click("[data-main]")
        tablet.wait_for_function("() => document.body.dataset.step >= 2")
        expect(pt.locator("[data-presence=tablets]")).to_contain_text("connected")
        tablet.click("[data-change=pause]")  # whoever walks may always rest
        tablet.wait_for_selector("body[data-look=paused]")
        assert not tablet.is_visible("[data-change=resume]")
        expect(pt.locator("[data-main]")).to_contain_text("Go on")
        pt.click("[data-end]")
        pt.click("text=End session")
        go_on_to_scores(tablet)
        expect(tablet.locator(".you >> visible=true")).to_be_in_viewport()

        pt.goto("/start/")  # somebody else is next, while these scores are still shown
        pt.click("text=Try a demo")
        pt.click("text=Change something")
        pt.click("text=To the therapist")
        pt.wait_for_selector("[data-main]:not([disabled])")
        asked_at = time.monotonic()
        tablet.wait_for_selector("body[data-look=ready]")
        assert time.monotonic() - asked_at <= 2
        expect(pt.locator(".readiness")).to_contain_text("✓ Tablet shows Demo")
        pt.click("[data-end]")
        pt.click("text=End session")
        go_on_to_scores(tablet)
        tablet.click("text=Continue")
        expect(tablet.locator("h1")).to_have_text("Ready.", timeout=PATIENCE_MS)
