"""An empty clinic is walked through: station, tablet, sensor, first patient."""

from __future__ import annotations

import shlex
import subprocess
import sys

import pytest
from playwright.sync_api import expect

from tests.support.servers import ROOT, Server

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
    page.click("text=It shows this code")
    expect(page.locator("[data-live=tablet]")).to_contain_text("seen just now")
    expect(page.get_by_text("Next step")).to_be_visible()
    expect(page.get_by_text("Skip this step")).to_be_hidden()

    # The sensor gets a token.
    page.click("[data-step=sensor] a")
    page.click("text=Force plates, a motion laboratory")
    page.fill("[name=name]", "Force plate")
    page.click("details[open] .primary")
    token = page.locator("#token").inner_text().strip()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # What is a clinic's own is filled into the line: quoted, never what a shell would run.
    page.click("text=Lab Streaming Layer")
    forces, mass = (page.locator(f"[open] [data-fills={one}]") for one in ("forces", "mass"))
    for typed, stands in (("Our plates", "Our plates"), ("$(reboot)", "Treadmill")):
        forces.fill(typed)
        mass.fill("72,5")
        told = shlex.split(page.locator("details[open] code").last.inner_text())
        assert told[3:8] == ["lsl", "--stream", stands, "Mocap", "--mass"]
        assert told[8] == "72.5"
    # Its program's line is copied as it stands, and is seen to work on the same page.
    page.click("text=simulated patient")
    line = shlex.split(page.locator("details[open] code").last.inner_text())
    assert line[-4:] == ["--server", server.url, "--token", token]
    command, seen = [sys.executable, *line[1:]], page.locator("[data-live=sensor].done")
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL) as running:
        try:
            expect(seen).to_have_text("Force plate is connected.", timeout=30_000)
            page.click("text=I have copied it")
            expect(seen).to_have_text("Force plate is connected.")
        finally:
            running.terminate()

    # Once its program has ended, the page tells so and leads to its line, not to another sensor.
    expect(page.locator("[data-live=sensor]")).to_contain_text("Not connected", timeout=30_000)
    expect(page.get_by_text("Make a new start command")).to_be_visible()
    expect(page.get_by_text("A phone on the shin")).to_be_hidden()

    # What was skipped stays open; the last step leads to a patient.
    page.click("text=Skip this step")
    expect(page.locator("[data-step=sensor]")).to_contain_text("skipped")
    page.click("main >> text=New patient")
    page.wait_for_url("**/patients/new/")

    # Stations and devices have a page of their own: the token ends with two taps.
    page.goto("/stations/")
    device = page.locator(".entry", has_text="Force plate")
    device.get_by_text("More").click()
    device.locator("[name=revoke]").click()
    expect(page.locator(".entry", has_text="Force plate")).to_contain_text("revoked")
