"""The patient's page in a browser, for tests of what is on it."""

from __future__ import annotations

import sqlite3
from typing import Any

from playwright.sync_api import BrowserContext, Page
from playwright.sync_api import TimeoutError as PlaywrightTimeout

from tests.support.browsers import SIZES
from tests.support.servers import Server
from tests.support.walk_seed import Walk, feet_of

# What is on the page, in one word: the same after a reload, and on a second tablet.
DIGEST = """() => ({
  look: document.body.dataset.look, theme: document.body.dataset.theme,
  words: document.querySelector(".words").textContent,
  emblem: document.querySelector(".emblem svg").dataset.emblem,
  key: document.querySelector(".key").textContent,
  time: document.querySelector(".time").textContent,
  dots: [...document.querySelectorAll(".dots circle")].map((dot) =>
    dot.matches(".gap") ? "gap" : [dot.matches(".hit"), dot.getAttribute("cy")]),
})"""


def open_page(context: BrowserContext, walk: Walk, size: str = "tablet-portrait") -> Page:
    """Open a page whose complaints fail the test."""
    width, height = SIZES[size]
    page = context.new_page()
    page.set_viewport_size({"width": width, "height": height})
    page.goto(walk.path)
    return page


def start(page: Page, server: Server, walk: Walk) -> None:
    """Tap Start, which is there while a sensor is; the sensor goes again."""
    with feet_of(server, walk):
        page.click("[data-change=start]")
        page.wait_for_selector("body:not([data-look=ready])")


def until_step(page: Page, number: int) -> None:
    try:
        page.wait_for_function("n => document.body.dataset.step == n", arg=number)
    except PlaywrightTimeout as problem:
        state = page.evaluate("JSON.stringify(document.body.dataset)")
        raise AssertionError(f"step {number} was not drawn; the page is at {state}") from problem


def stored(server: Server, walk: Walk) -> list[dict[str, Any]]:
    database = sqlite3.connect(server.folder / "garry.sqlite3")
    database.row_factory = sqlite3.Row
    rows = database.execute(
        "SELECT * FROM rehab_step WHERE session_id = ? ORDER BY number", (walk.session,)
    ).fetchall()
    database.close()
    return [dict(row) for row in rows]
