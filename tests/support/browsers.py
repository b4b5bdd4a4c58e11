"""A real browser for tests and pictures."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright

from tests.support.servers import Server
from tests.support.walk_seed import Walk

SIZES = {
    "phone": (390, 844),
    "tablet-portrait": (800, 1280),
    "tablet-landscape": (1280, 800),
    "laptop": (1440, 900),
}


PATIENCE_MS = 40_000  # a loaded machine draws eight pages slowly
Visit = Callable[..., Page]  # the fixture `visit` (tests/browser/conftest.py)


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


@contextmanager
def signed_in(
    browser: Browser,
    server: Server,
    walk: Walk | None = None,
    size: str | None = None,
    *,
    port: int = 0,
    alone: bool = False,
    **options: Any,
) -> Iterator[BrowserContext]:
    """Open a browser where the walk's PT is signed in, or without one the first account.

    Parameters
    ----------
    size
        Of its windows, by ``SIZES``.
    port
        Through which it reaches the server, if that is another one.
    alone
        Whether it is the walk's paired tablet.
    """
    url = f"http://127.0.0.1:{port or server.port}"
    if size is not None:
        options["viewport"] = dict(zip(("width", "height"), SIZES[size], strict=True))
    context = browser.new_context(base_url=url, **options)
    context.set_default_timeout(PATIENCE_MS)
    if walk is None:
        page = context.new_page()
        page.goto("/start/")
        sign_in(page, server.password)
        page.wait_for_url("**/start/")
        page.close()
    else:
        name, value = ("garry_tablet", walk.tablet) if alone else ("sessionid", walk.cookie)
        context.add_cookies([{"name": name, "value": value, "url": url}])
    yield context
    context.close()


def sign_in(page: Page, password: str, name: str = "pt") -> None:
    """Fill in the sign-in that a page shows, and send it."""
    page.fill("#id_username", name)
    page.fill("#id_password", password)
    page.press("#id_password", "Enter")


def go_on_to_scores(page: Page) -> None:
    """Go on from the page that ends a walk."""
    page.wait_for_url("**/ending/")
    page.click(".go")
    page.wait_for_url("**/scores/")


def picture(page: Page, name: str) -> None:
    """Keep a picture in the folder GARRY_TEST_PICTURES, where somebody wants to look at it."""
    if folder := os.environ.get("GARRY_TEST_PICTURES"):
        page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)


class SharedChromium:
    """Chromium that stays until it is closed, and is started again when asked for.

    Attributes
    ----------
    page_errors
        Errors in scripts that no page has caught, of all pages. They are kept and not raised:
        an exception in a listener ends Playwright's event loop, and all tests after it fail.
    """

    def __init__(self) -> None:
        self.page_errors: list[str] = []
        self._running: AbstractContextManager[Browser] | None = None
        self._browser: Browser | None = None

    def browser(self) -> Browser:
        """Return the running browser, started where need be."""
        if self._running is None:
            self._running = chromium()
            self._browser = self._running.__enter__()
            self._browser.on("context", self._listen)
        assert self._browser is not None
        return self._browser

    def _listen(self, context: BrowserContext) -> None:
        context.on(
            "weberror",
            lambda error: self.page_errors.append(
                f"{error.page and error.page.url}: {error.error}"
            ),
        )

    def close(self) -> None:
        """Close the browser, if it runs."""
        if self._running is not None:
            running, self._running = self._running, None
            running.__exit__(None, None, None)


# Every visible text of the page: its words, size, and contrast with what is painted behind it.
READ_TEXTS = """() => {
  const channel = (c) => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
  const behind = (element) => {
    for (let node = element; node; node = node.parentElement) {
      const color = numbers(getComputedStyle(node).backgroundColor);
      if (color.length < 4 || color[3] === 1) return color;
    }
    return [255, 255, 255];
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const texts = [];
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    const words = walker.currentNode.textContent.trim();
    if (!words || !element.checkVisibility() || element.closest("[aria-hidden=true]")) continue;
    const style = getComputedStyle(element);
    const [a, b] = [light(numbers(style.color)), light(behind(element))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    texts.push({ words, size: parseFloat(style.fontSize), contrast });
  }
  return texts;
}"""


def can_be_read(page: Page) -> None:
    """Fail where a patient's page cannot be read from 1.5 m, or tapped by a stiff hand."""
    texts = page.evaluate(READ_TEXTS)
    assert len(texts) > 5
    for text in texts:
        assert text["size"] >= 32, text
        assert text["contrast"] >= 7, text
    for control in page.locator("button:visible, a:visible").all():
        box = control.bounding_box()
        assert box is not None, control
        assert box["height"] >= 72, control
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
