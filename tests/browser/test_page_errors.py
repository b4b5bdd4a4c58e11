"""A script's error on a page fails the test that met it, and no other."""

from __future__ import annotations

import pytest
from playwright.sync_api import Browser

from tests.support.browsers import SharedChromium

pytestmark = pytest.mark.browser

RAISES = "data:text/html,<script>setTimeout(() => { throw Error('not caught') })</script>"


@pytest.mark.essential
def test_an_error_that_no_page_caught_is_kept_for_the_end_of_its_test(
    browser: Browser, shared_chromium: SharedChromium
) -> None:
    with browser.new_context() as context:
        page = context.new_page()
        with context.expect_event("weberror"):
            page.goto(RAISES)
        page.goto("about:blank")  # Playwright goes on
    (error,) = shared_chromium.page_errors
    assert "not caught" in error
    shared_chromium.page_errors.clear()
