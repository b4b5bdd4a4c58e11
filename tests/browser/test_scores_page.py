"""The scores page in Chromium: the newest score is found, marked, and can be read at 1.5 m."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import SIZES, can_be_read, sign_in
from tests.support.servers import Server

pytestmark = pytest.mark.browser

SEED = """
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from tests.support.walks import make_patient, strides, walk
rosa = make_patient(first_clinic(), code="R-1")
for index in range(14):
    walk(rosa, "positive", strides(10 + index, 10), days_ago=20 - index, now=timezone.now())
walk(rosa, "binary", strides(30, 3), days_ago=2, now=timezone.now())
print(walk(rosa, "positive", strides(13, 10), now=timezone.now()).pk)
print(walk(rosa, "negative", strides(12, 3), now=timezone.now()).pk)
"""
BLUE = "rgb(10, 63, 168)"
NO_ROW_CUT = """() => {
  const board = document.querySelector(".board:not([hidden])").getBoundingClientRect();
  const rows = [...document.querySelectorAll(".board:not([hidden]) li")];
  const seen = rows.filter((row) => getComputedStyle(row).opacity > 0)
    .map((row) => row.getBoundingClientRect());
  const shown = seen.filter(({ top, bottom }) => bottom > board.top + 9 && top < board.bottom - 9);
  return shown.length > 1
    && shown.every(({ top, bottom }) => top > board.top - 9 && bottom < board.bottom + 9);
}"""
TABLETS = ("tablet-portrait", "tablet-landscape")


@pytest.fixture(scope="module")
def sessions(server) -> tuple[str, str]:
    """The newest positive and the newest negative session."""
    positive, negative = server.run_shell(SEED).split()
    return positive, negative


@contextmanager
def tablet(browser: Browser, server: Server, size: str, *, still: bool = False) -> Iterator[Page]:
    """Return a page of a signed-in tablet that is only tapped. Complaints fail."""
    width, height = SIZES[size]
    context = browser.new_context(
        base_url=server.url,
        viewport={"width": width, "height": height},
        has_touch=True,
        reduced_motion="reduce" if still else "no-preference",
    )
    page = context.new_page()
    page.goto("/admin/")
    sign_in(page, server.password)
    complaints: list[str] = []
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    yield page
    context.close()
    assert complaints == []


def is_in_view(page: Page, board: str) -> bool:
    """Return whether the marked row lies whole within the board that is shown."""
    inside: bool = page.evaluate(
        """(board) => {
          const place = document.getElementById(board).getBoundingClientRect();
          const row = document.querySelector(`#${board} .you`).getBoundingClientRect();
          return row.height > 0 && row.top >= place.top - 1 && row.bottom <= place.bottom + 1;
        }""",
        board,
    )
    return inside


@pytest.mark.parametrize("size", TABLETS)
def test_the_list_glides_to_the_newest_score_which_then_stands_out(server, sessions, browser, size):
    with tablet(browser, server, size) as page:
        page.goto(f"/sessions/{sessions[0]}/scores/")
        board = page.locator("#board-same")
        expect(board).to_have_class("board gliding")
        assert not is_in_view(page, "board-same")
        expect(board).to_have_class("board", timeout=6000)
        assert is_in_view(page, "board-same")
        row = board.locator(".you")
        expect(row).to_have_css("background-color", BLUE)
        expect(row).to_contain_text("You today")
        expect(row.locator(".value")).to_have_text("13")
        expect(row).to_have_attribute("aria-current", "true")
        sizes = board.locator(".value").evaluate_all(
            "all => all.map((one) => parseFloat(getComputedStyle(one).fontSize))"
        )
        assert max(sizes) >= 1.5 * sorted(sizes)[-2]
        assert board.locator(".you").count() == 1


@pytest.mark.parametrize("size", TABLETS)
def test_one_list_of_own_scores_leads_on_at_the_right(server, sessions, browser, size):
    with tablet(browser, server, size, still=True) as page:
        page.goto(f"/sessions/{sessions[0]}/scores/")
        expect(page.get_by_role("heading")).to_have_text("Your best scores")
        assert page.get_by_role("tab").count() == 0
        way_on = page.get_by_role("link", name="Done")
        box = way_on.bounding_box()
        assert box is not None
        assert box["x"] + box["width"] / 2 >= SIZES[size][0] / 2
        way_on.tap()
        page.wait_for_url("**/patients/*/")


def test_with_reduced_motion_the_score_is_there_at_once(server, sessions, browser):
    with tablet(browser, server, "tablet-portrait", still=True) as page:
        page.goto(f"/sessions/{sessions[0]}/scores/")
        assert page.locator(".gliding").count() == 0
        assert is_in_view(page, "board-same")
        expect(page.locator("#board-same .you")).to_have_css("background-color", BLUE)


@pytest.mark.parametrize("size", TABLETS)
def test_no_row_is_cut_by_the_edge_of_the_list(server, sessions, browser, size):
    with tablet(browser, server, size, still=True) as page:
        page.goto(f"/sessions/{sessions[0]}/scores/")
        page.wait_for_function(NO_ROW_CUT)


@pytest.mark.parametrize("size", TABLETS)
@pytest.mark.parametrize("which", [0, 1], ids=["positive", "negative"])
def test_everything_can_be_read_at_arms_length_and_more(server, sessions, browser, size, which):
    with tablet(browser, server, size, still=True) as page:
        page.goto(f"/sessions/{sessions[which]}/scores/")
        can_be_read(page)
