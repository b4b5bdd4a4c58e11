"""A real browser for tests and pictures."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

SIZES = {
    "phone": (390, 844),
    "tablet-portrait": (800, 1280),
    "tablet-landscape": (1280, 800),
    "laptop": (1440, 900),
}


@contextmanager
def chromium() -> Iterator[Browser]:
    """Run the machine's own Chromium, without a network of its own."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--disable-background-networking", "--disable-sync"],
        )
        yield browser
        browser.close()
