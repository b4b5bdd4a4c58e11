"""The tour of five minutes goes along with what is done, can be left, and goes on later."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

pytestmark = pytest.mark.browser


def test_it_goes_along_can_be_left_and_is_taken_up_again(visit) -> None:
    page = visit("/start/", size="laptop")
    page.click("text=Five-minute tour")
    tour = page.locator(".tour")
    expect(tour).to_contain_text("1 / 8")
    page.get_by_role("button", name="Try a demo").click()
    page.wait_for_url("**/patients/*/")
    expect(tour).to_contain_text("2 / 8")  # by what was done, without a button
    page.click("text=Leave the tour")
    expect(tour).to_have_count(0)
    page.goto("/help/")
    page.click("text=Go on with the tour")
    expect(tour).to_contain_text("2 / 8")
    page.click(".all .tap")
    page.click("button[value=monitor]")
    expect(tour).to_contain_text("Tap “Start”")
    expect(page.locator("[data-main]")).to_be_in_viewport(ratio=1)  # what is to be tapped
    for number in range(4, 7):
        tour.get_by_role("button", name="Next step").click()
        expect(tour).to_contain_text(f"{number} / 8")
    tour.get_by_role("button", name="Next step").click()
    tour.get_by_role("button", name="Next step").click()
    expect(tour).to_contain_text("Now your own")
    tour.get_by_role("link", name="First steps").click()
    tour.get_by_role("button", name="End the tour").click()
    expect(tour).to_have_count(0)
    page.goto("/help/")
    expect(page.get_by_text("Five-minute tour")).to_be_visible()
