"""A session's room, played again from its log."""

from __future__ import annotations

import json

import pytest
from playwright.sync_api import Page, expect

from robot.wire.incident import pack
from tests.support.incidents import BUMPED
from tests.support.walk_seed import feet_of, make_walks, robot_of

pytestmark = pytest.mark.browser

CELEBRATES = {"kind": "gesture", "name": "celebrate", "phase": "started", "outcome": ""}


def shown(page: Page) -> tuple[str, str, str]:
    """Return the stride that the room shows, and the patient's page's step and points."""
    patient = page.frame_locator(".screen iframe")
    number = page.locator("[data-show=number]").inner_text()
    step = patient.locator("body").get_attribute("data-step") or ""
    return number, step, patient.locator(".key").inner_text()


def test_room_is_played_again_from_its_log(server, visit):
    (walk,) = make_walks(server, {"valence": "positive"})
    page = visit(walk.monitor_path, walk, "laptop")
    with feet_of(server, walk) as feet, robot_of(server, walk, "kobuki") as robot:
        page.click("[data-main]:not([disabled])")
        page.wait_for_selector("[data-main][value=pause]")
        feet.walk(1.1, 0.9)
        robot.send(json.dumps({"type": "report", "report": CELEBRATES}))
        page.click("[data-remark=dizziness]")
        expect(page.locator(".said")).to_contain_text("dizziness")
        page.click("[data-write]")
        page.fill("#note", "Held on with the left hand.")
        page.click("#written .primary")
        expect(page.locator(".said")).to_contain_text("Held on")
        page.click("[data-goal='1']")
        page.wait_for_selector("[data-show=goal]:text-is('4.10')")
        feet.walk(1.2, None, 1.3)
        robot.send(
            json.dumps(
                {
                    "type": "incident",
                    "session": walk.session,
                    "reason": "bump",
                    "ago_s": 0.0,
                    "recording": pack(BUMPED),
                }
            )
        )
        page.wait_for_selector("[data-incident]:visible")
        live = page.frame_locator(".mirror iframe")
        live.locator("body[data-step='5']").wait_for()
        points_then = live.locator(".key").inner_text()
    page.goto(f"/sessions/{walk.session}/details/")
    expect(page.locator(".note")).to_contain_text("Held on with the left hand.")
    page.click("text=Replay")

    # Step by step: each page shows what it showed then.
    patient = page.frame_locator(".screen iframe")
    patient.locator("body[data-look=begin]").wait_for()
    for number, points in enumerate(("1", "1", "2", "2", "3"), start=1):
        page.click("[data-step='1']")
        patient.locator(f"body[data-step='{number}']").wait_for()
        assert shown(page) == (f"no. {number}", str(number), points)
    assert points == points_then
    assert page.locator("#strip .remark").count() == 1
    assert page.locator("#strip .on-cloth").text_content() == "4.10"
    page.click("[data-step='-1']")
    patient.locator("body[data-step='4']").wait_for()
    assert patient.locator(".words").inner_text() == "Not seen."

    # A note leads to its moment; that moment has an address.
    page.click(".told button:has-text('Dizziness')")
    patient.locator("body[data-step='2']").wait_for()
    page.wait_for_function("() => location.search.startsWith('?at=')")
    page.reload()
    patient.locator("body[data-step='2']").wait_for()
    page.goto(f"/sessions/{walk.session}/replay/#stride-5")
    patient.locator("body[data-step='5']").wait_for()

    # The robot went as its black box recorded, to the place where it stopped.
    page.evaluate("replayPlayer.moveTo(replayPlayer.took_s)")
    page.wait_for_function(
        "() => parseFloat(document.querySelector('#scene .robot-base').dataset.pose) > 0.1"
    )
    # Played to its end, it stands there.
    page.evaluate("replayPlayer.moveTo(0)")
    page.select_option("[data-speed]", "16")
    page.click("[data-play]")
    patient.locator("body[data-step='5']").wait_for()
    page.wait_for_function("() => !replayPlayer.isPlaying")
