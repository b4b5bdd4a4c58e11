"""Where things are on a page: what leaves the screen, overlaps, is cut, or is too small to tap."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Page

from tests.support.extent import EVERYTHING

# Every size that people have walked with; `make test` tries those where it is tightest.
SCREENS = {
    "phone": (390, 844),
    "tablet-portrait": (800, 1280),
    "old-laptop": (1024, 768),
    "tablet-landscape": (1280, 800),
    "low-laptop": (1366, 768),
    "laptop": (1440, 900),
    "wall": (3840, 2160),
}
CORNERS = ("phone", "old-laptop", "low-laptop") if not EVERYTHING else tuple(SCREENS)
# German has the longest words.
LANGUAGES = ("de", "en", "es", "fr") if EVERYTHING else ("de",)

# Complaints about the elements that a selector finds: each whole on the screen, on top at its
# middle, at least so large, none over another, and no text of theirs cut.
COMPLAIN = """([selector, least]) => {
  const found = [...document.querySelectorAll(selector)].filter((one) => one.checkVisibility(
    { opacityProperty: true, visibilityProperty: true }));
  const name = (one) => one.className + " " + (one.innerText || one.getAttribute("aria-label"));
  const boxes = found.map((one) => one.getBoundingClientRect());
  const said = [];
  found.forEach((one, i) => {
    const { left, top, right, bottom, width, height } = boxes[i];
    if (left < -0.5 || top < -0.5 || right > innerWidth + 0.5 || bottom > innerHeight + 0.5)
      said.push(`${name(one)} leaves the screen`);
    if (Math.min(width, height) < least - 0.5)
      said.push(`${name(one)} is ${Math.round(width)} x ${Math.round(height)}`);
    const on = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    if (!one.contains(on)) said.push(`${name(one)} is under ${on?.outerHTML.slice(0, 80)}`);
    for (const part of [one, ...one.querySelectorAll("span, b")])
      if (part.clientWidth && part.scrollWidth > part.clientWidth + 1)
        said.push(`${name(part)} is cut: ${part.scrollWidth} in ${part.clientWidth}`);
    boxes.slice(0, i).forEach((other, j) => {
      if (left < other.right - 0.5 && other.left < right - 0.5 &&
          top < other.bottom - 0.5 && other.top < bottom - 0.5)
        said.push(`${name(one)} overlaps ${name(found[j])}`);
    });
  });
  return said;
}"""
# Elements whose contents are wider or higher than themselves.
CUT = """(selector) => [...document.querySelectorAll(selector)]
  .filter((one) => one.checkVisibility() && !one.closest(".visually-hidden"))
  .filter((one) => one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1)
  .map((one) => `${one.className || one.tagName} "${one.innerText.slice(0, 60)}": ` +
    `${one.scrollWidth} x ${one.scrollHeight} in ${one.clientWidth} x ${one.clientHeight}`)"""
# Elements whose words are wider than they are.
TOO_WIDE = """(selector) => [...document.querySelectorAll(selector)]
  .filter((one) => one.checkVisibility({ visibilityProperty: true }))
  .filter((one) => one.clientWidth && one.scrollWidth > one.clientWidth + 1)
  .map((one) => `${one.className} "${one.innerText}": ${one.scrollWidth} in ${one.clientWidth}`)"""
SMALL = """([selector, least]) => [...document.querySelectorAll(selector)]
  .filter((one) => one.checkVisibility()).map((one) => [one, one.getBoundingClientRect()])
  .filter(([, { width, height }]) => Math.min(width, height) < least - 0.5)
  .map(([one, { width, height }]) => `${one.outerHTML.slice(0, 80)}: ${width} x ${height}`)"""


DRAWN = """async () => {
  dispatchEvent(new Event("resize"));
  await new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)));
}"""
# The page as a language from right to left would have it: each letter is a Hebrew one, which stays
# until the words are put back.
TURN = """(done) => {
  if (done) {
    document.documentElement.dir = "ltr";
    for (const [node, was, now] of window.turned) if (node.data === now) node.data = was;
    return;
  }
  document.documentElement.dir = "rtl";
  window.turned = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode, was = node.data;
    if (node.parentElement.closest("script, style, [dir=ltr]")) continue;
    node.data = was.replace(/\\p{L}/gu, (letter) =>
      "אבגדהוזחטיכלמנסעפצקרשת"[letter.codePointAt() % 22]);
    window.turned.push([node, was, node.data]);
  }
}"""


def set_screen(page: Page, name: str) -> None:
    """Give a page's window a size, and the page a moment to draw for it."""
    width, height = SCREENS[name]
    page.set_viewport_size({"width": width, "height": height})
    page.evaluate(
        "() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame("
        "() => setTimeout(drawn))))"
    )


@contextmanager
def from_right_to_left(page: Page) -> Iterator[None]:
    """Turn a page and its words around for a while."""
    page.evaluate(TURN, False)
    page.evaluate(DRAWN)
    yield
    page.evaluate(TURN, True)
    page.evaluate(DRAWN)


def complaints(page: Page, selector: str, least: int) -> list[str]:
    """Return what is wrong with where elements are, or with their size."""
    said: list[str] = page.evaluate(COMPLAIN, [selector, least])
    return said


def cut(page: Page, selector: str) -> list[str]:
    """Return the elements that do not show all that is in them."""
    said: list[str] = page.evaluate(CUT, selector)
    return said


def too_small(page: Page, selector: str, least: int) -> list[str]:
    """Return the elements that are narrower or lower than so many pixels."""
    said: list[str] = page.evaluate(SMALL, [selector, least])
    return said


def boxes(page: Page, selector: str) -> list[dict[str, Any]]:
    """Return where elements are, in pixels of the window."""
    return [dict(box) for one in page.locator(selector).all() if (box := one.bounding_box())]
