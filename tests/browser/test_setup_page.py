"""The set-up at the tightest sizes and with the longest words: all can be read and tapped."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.support.browsers import Visit
from tests.support.layout import CORNERS, SCREENS, TOO_WIDE, boxes, set_screen, too_small
from tests.support.servers import Server
from tests.support.walk_seed import make_walks

pytestmark = pytest.mark.browser


def test_all_choices_can_be_read_and_tapped(server: Server, visit: Visit) -> None:
    (walk,) = make_walks(server, {"name": "Rosalinda"})
    page = visit("/account/", walk)
    page.select_option("#language", "de")
    page.click("form[action*=language] button")
    page.goto("/patients/1/new/")
    page.click(".try summary")
    expect(page.locator(".try [value='synthetic demo']")).to_be_attached()
    for screen in CORNERS:
        set_screen(page, screen)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        words = ".row-choice, .seg label, .outline *, .pick, .pick span, .go .btn, .preset"
        assert page.evaluate(TOO_WIDE, words) == []
        assert too_small(page, ".row-choice, .seg label, .go .btn, .pick select", 44) == []
        (go,) = boxes(page, ".go .primary")  # never below the screen's edge
        assert go["y"] + go["height"] <= SCREENS[screen][1] + 1
