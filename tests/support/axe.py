"""What axe-core complains of on a page as it is now."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page

from tests.support.servers import ROOT

AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
STANDARDS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
# WCAG 1.4.6: 7:1, for whoever reads from a treadmill.
ENHANCED = {"color-contrast-enhanced": {"enabled": True}}
CHECK = """async ([rules, standards]) => {
  const { violations } = await axe.run(document, { runOnly: standards, rules });
  const tell = ({ id, help, nodes }) =>
    [`${id}: ${help}`, ...nodes.map(({ target, html }) => `  ${target.join(" ")} ${html}`)];
  return violations.flatMap(tell).join("\\n");
}"""
COLORS_HAVE_CHANGED = "Promise.all(document.getAnimations().map((one) => one.finished))"


def check(page: Page, *, for_patients: bool = False) -> None:
    """Fail with axe-core's complaints about a page as it is now."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE.read_text())
    if complaints := page.evaluate(CHECK, [ENHANCED if for_patients else {}, STANDARDS]):
        pytest.fail(f"{page.url}\n{complaints}")


def go_dark(page: Page) -> None:
    """Turn a page dark, as the header's button does."""
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.wait_for_selector("html[data-pt=dark]")
    page.evaluate(COLORS_HAVE_CHANGED)
