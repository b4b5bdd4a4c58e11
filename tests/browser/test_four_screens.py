"""One session on two tablets and two therapists' screens: all say the same, whoever steers."""

from __future__ import annotations

from contextlib import ExitStack

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import SIZES
from tests.support.patient_page import DIGEST, open_page, signed_in, stored, until_step
from tests.support.servers import Server
from tests.support.walk_seed import Feet, Walk, feet_of, make_walks

pytestmark = pytest.mark.browser

TOLD = ("performance", "number", "goal", "of-twenty", "judged")


def told(monitor: Page) -> list[str]:
    """Return what a therapist's page says of the session's strides."""
    return [monitor.locator(f"[data-show={name}]").inner_text() for name in TOLD]


def test_two_tablets_and_two_monitors_tell_one_story(server: Server, browser: Browser) -> None:
    (walk,) = make_walks(server, {"valence": "binary"})
    with ExitStack() as stack, feet_of(server, walk) as feet:
        # Contexts of their own: a tab behind another one is not drawn.
        one, other, laptop, phone = (
            stack.enter_context(signed_in(browser, server, walk)) for _ in range(4)
        )
        tablets = [open_page(one, walk), open_page(other, walk, "tablet-landscape")]
        monitors = [laptop.new_page(), phone.new_page()]
        for monitor, size in zip(monitors, ("laptop", "phone"), strict=True):
            width, height = SIZES[size]
            monitor.set_viewport_size({"width": width, "height": height})
            monitor.goto(f"/sessions/{walk.session}/monitor/")
        tablets[1].click("text=Start")
        expect(monitors[1].locator("[data-main]")).to_have_attribute("value", "pause")

        _walk(feet, walk, server, tablets, 1.1, 0.9, None)
        monitors[1].click("[data-goal='1']")  # by the phone; the laptop follows
        goal = monitors[1].locator("[data-show=goal]")
        expect(goal).not_to_have_text("4.00")
        expect(monitors[0].locator("[data-show=goal]")).to_have_text(goal.inner_text())
        _walk(feet, walk, server, tablets, 1.01)
        assert stored(server, walk)[-1]["goal"] == float(goal.inner_text())

        monitors[0].click("[data-main]")  # paused by the laptop
        for tablet in tablets:
            tablet.wait_for_selector("body[data-look=paused]")
        expect(monitors[1].locator("[data-main]")).to_have_attribute("value", "resume")
        tablets[0].get_by_role("button", name="Go on").click()
        expect(monitors[0].locator("[data-main]")).to_have_attribute("value", "pause")
        _walk(feet, walk, server, tablets, 1.3)
        expect(monitors[1].locator("[data-show=number]")).to_contain_text(str(feet.number))
        expect(monitors[0].locator("[data-show=number]")).to_contain_text(str(feet.number))
        assert told(monitors[0]) == told(monitors[1])


def _walk(
    feet: Feet, walk: Walk, server: Server, tablets: list[Page], *performances: float | None
) -> None:
    """Take steps, and see both tablets say the same of them, as stored."""
    feet.walk(*performances)
    shown = []
    for tablet in tablets:
        until_step(tablet, feet.number)
        tablet.wait_for_timeout(400)  # the points have counted up
        shown.append(tablet.evaluate(DIGEST))
    assert {name: shown[0][name] for name in ("look", "words", "emblem", "key", "run")} == {
        name: shown[1][name] for name in ("look", "words", "emblem", "key", "run")
    }
    points = sum(step["points"] or 0 for step in stored(server, walk))
    assert shown[0]["key"] == str(points).replace("-", "−")
