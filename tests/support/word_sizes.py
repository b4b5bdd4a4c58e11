"""The patient's page in each layout and size of words: put on, and measured."""

from __future__ import annotations

from typing import Any

from playwright.sync_api import Page

from rehab.sessions.pages.walk import COLUMNS
from tests.support.layout import DRAWN, SCREENS, set_screen

SIDES = ("right", "left", "center", "in_right", "in_left")
# Nobody walks on: the page must not say so.
NEVER_STILL = """() => { const after = window.setTimeout;
  window.setTimeout = (act, ms, ...rest) => ms === 4000 ? 0 : after(act, ms, ...rest); }"""
MEASURE = """() => {
  const size = (name) => parseFloat(getComputedStyle(document.querySelector(name)).fontSize);
  const box = (name) => { const { left, top, right, bottom } =
    document.querySelector(name).getBoundingClientRect(); return [left, top, right, bottom]; };
  const shown = (name) => document.querySelector(name).getBoundingClientRect().width > 0;
  const { drop, short } = document.body.dataset;
  const probe = document.body.appendChild(document.createElement("i"));
  probe.style.cssText = "position: absolute; width: var(--degree)";
  const degree = probe.getBoundingClientRect().width;
  probe.remove();
  return { word: size(".words"), key: size(".key"), degree, drop: Number(drop),
    short: Number(short ?? 1), words: box(".words"), number: box(".key"), head: box("header"),
    buttons: [...document.querySelectorAll("header button")].filter((one) => one.checkVisibility())
      .map((one) => { const { left, right } = one.getBoundingClientRect(); return [left, right]; }),
    tube: box(".shell.wall"), badge: box(".emblem svg"),
    ground: document.querySelector(".ground").getBoundingClientRect().top,
    label: box(".label"), foot: document.querySelector(".thermometer .foot").getScreenCTM().a > 0,
    emblem: shown(".emblem"), scene: shown(".thermometer"), chart: shown(".strides") };
}"""


def look(page: Page, side: str, screen: str, text: str, degree: float | None) -> dict[str, Any]:
    """Return how large the page's words are on a screen of so many pixels a degree."""
    if page.viewport_size != dict(zip(("width", "height"), SCREENS[screen], strict=True)):
        set_screen(page, screen)
    column = COLUMNS.get(side, "")
    page.evaluate(
        """([side, column, text, degree]) => {
          const { dataset, style } = document.body;
          if (column) dataset.column = column;
          else delete dataset.column;
          dataset.side = column || side;
          dataset.text = text;
          if (degree) dataset.pxPerMm = 1;
          else delete dataset.pxPerMm;
          if (degree) style.setProperty("--degree", `${degree}px`);
          else style.removeProperty("--degree");
        }""",
        [side, column, text, degree],
    )
    page.evaluate(DRAWN)
    found: dict[str, Any] = page.evaluate(MEASURE)
    return found
