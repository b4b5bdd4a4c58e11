"""An empty clinic is walked through: station, tablet, sensor, first patient."""

from __future__ import annotations

import json

import pytest
from playwright.sync_api import expect
from websockets.sync.client import connect

from tests.support.servers import Server

pytestmark = pytest.mark.browser


def test_empty_clinic_is_walked_through_and_sees_each_step_work(server: Server, browser, visit):
    page = visit("/start/", size="phone")
    first = page.get_by_text("First steps, one by one")
    expect(first).to_be_in_viewport(ratio=1)  # on a phone, too
    first.click()

    page.click("[data-step=station] a")
    page.fill("[name=name]", "Treadmill")
    page.click("text=Save")
    assert page.locator("[data-step=station]").get_attribute("class") == "done"

    # A tablet that shows its code is let in, and is seen to be there without a reload.
    tablet = browser.new_context(base_url=server.url).new_page()
    tablet.goto("/tablet/")
    page.fill("[name=code]", tablet.locator(".code").inner_text().replace(" ", ""))
    page.click("text=Compare the code")
    page.click("text=It shows this code")
    expect(page.locator("[data-live=tablet]")).to_contain_text("seen just now")
    expect(page.get_by_text("Next step")).to_be_visible()
    expect(page.get_by_text("Skip this step")).to_be_hidden()

    # The sensor gets a token, and is seen to be connected.
    page.click("[data-step=sensor] a")
    page.fill("[name=name]", "Force plate")
    page.click("text=Save")
    token = page.locator("#token").inner_text().strip()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.click("text=I have copied it")
    expect(page.locator("[data-live=sensor]")).to_contain_text("Not connected: Force plate")
    header = {"Authorization": f"Bearer {token}"}
    url = f"ws://127.0.0.1:{server.port}/ws/source/"
    with connect(url, additional_headers=header) as socket:
        socket.send(json.dumps({"type": "hello", "version": 1, "run": "a", "last": 0}))
        expect(page.locator("[data-live=sensor].done")).to_have_text("Force plate is connected.")

    # What was skipped stays open; the last step leads to a patient.
    page.click("text=Skip this step")
    expect(page.locator("[data-step=sensor]")).to_contain_text("skipped")
    page.click("main >> text=New patient")
    page.wait_for_url("**/patients/new/")

    # Stations and devices have a page of their own: the token ends with one tap.
    page.goto("/stations/")
    page.locator("section li", has_text="Force plate").locator("[name=revoke]").click()
    expect(page.locator("section li", has_text="Force plate")).to_contain_text("revoked")
