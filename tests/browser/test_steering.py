"""What a PT does while somebody walks reaches the tablet with the next step: each control of the
monitor, and words edited in the admin.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import signed_in
from tests.support.robot_reports import STATUS
from tests.support.servers import Server, serve
from tests.support.walk_seed import Walk, feet_of, hear, make_walks, robot_of
from tests.support.wire import Wire

pytestmark = pytest.mark.browser

PHASES = [
    {"kind": "training", "name": "First", "strides": 12},
    {"kind": "training", "name": "Last"},
]


@contextmanager
def pages(
    browser: Browser, server: Server, walk: Walk, path: str, port: int = 0
) -> Iterator[tuple[Page, Page]]:
    """Open the tablet's page and one of the PT's, through a port of a wire where there is one."""
    options: dict[str, Any] = {"port": port, "reduced_motion": "reduce"}
    with (
        signed_in(browser, server, walk, "tablet-portrait", **options) as one,
        signed_in(browser, server, walk, "laptop", **options) as other,
    ):
        tablet, pt = one.new_page(), other.new_page()
        tablet.goto(walk.path)
        pt.goto(path)
        yield tablet, pt


def at_step(tablet: Page, number: int) -> None:
    tablet.wait_for_function("n => document.body.dataset.step >= n", arg=number)


def pressed(monitor: Page, control: str, value: str) -> None:
    """Tap a control; wait until the server has it."""
    button = monitor.locator(f"[{control}] [value='{value}']")
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")


def test_every_control_of_the_monitor_reaches_the_tablet_with_the_next_step(server, browser):
    (walk,) = make_walks(server, {"valence": "positive", "phases": PHASES})
    where = walk.monitor_path
    with pages(browser, server, walk, where) as (tablet, monitor), feet_of(server, walk) as feet:
        words, emblem = tablet.locator(".words"), tablet.locator(".emblem svg")
        monitor.locator("[data-main]").click()
        monitor.locator(".controls summary").click()
        feet.hear("start")
        feet.walk(1.0)
        at_step(tablet, 1)
        expect(words).to_have_text("Goal met!")

        monitor.get_by_label("Goal up").click()
        expect(monitor.locator("[data-show=goal]")).to_have_text("4.10")
        expect(words).to_have_text("Goal met!")  # not before the next step
        feet.walk(1.0)
        at_step(tablet, 2)
        expect(words).to_have_text("Nearly there.")

        monitor.locator("[data-gains] [value='0.85']").click()
        expect(monitor.locator("[data-gains] .on")).to_have_text("0.85")
        feet.walk(0.9)
        at_step(tablet, 3)
        expect(words).to_have_text("To the next.")  # 0.85 × 3.6 of 4.1

        pressed(monitor, "data-words", "0")
        expect(words).to_have_text("To the next.")
        feet.walk(1.3)
        at_step(tablet, 4)
        expect(words).to_have_text("")
        expect(emblem).to_have_attribute("data-emblem", "gain")  # drawing and number stay
        expect(tablet.locator(".key")).to_have_text("2")
        pressed(monitor, "data-words", "1")

        pressed(monitor, "data-chart", "line")
        expect(tablet.locator("body")).to_have_attribute("data-chart", "points")
        feet.walk(1.3)
        at_step(tablet, 5)
        expect(tablet.locator("body")).to_have_attribute("data-chart", "line")
        expect(tablet.locator(".dots circle").first).to_be_hidden()
        expect(words).to_have_text("Goal met!")

        steer_the_robot(server, walk, monitor)

        monitor.select_option("[data-type]", "negative")
        expect(monitor.locator("[data-show=type-when]")).to_contain_text("from Last on")
        feet.walk(1.3, 1.3, 1.3, 1.3, 1.3, 1.3)
        at_step(tablet, 11)
        expect(tablet.locator("body")).to_have_attribute("data-theme", "positive")
        feet.walk(1.3)  # the twelfth ends the first phase
        expect(tablet.locator("body")).to_have_attribute("data-theme", "negative")
        expect(words).to_have_text("")  # what was said belongs to the type before
        feet.walk(0.5)
        at_step(tablet, 13)
        expect(words).to_have_text("Far below.")
        expect(emblem).to_have_attribute("data-emblem", "loss")
        expect(monitor.locator("[data-show=types]")).to_have_text("Positive, changed to Negative")

        # No phase with feedback follows the last one; the next stride does.
        expect(monitor.locator("[data-type] optgroup")).to_have_count(1)
        monitor.select_option("[data-type]", "now:binary")
        expect(tablet.locator("body")).to_have_attribute("data-theme", "binary")
        feet.walk(1.3)
        at_step(tablet, 14)
        expect(words).to_have_text("Truly good!")
        types = "Positive, changed to Negative, Binary"
        expect(monitor.locator("[data-show=types]")).to_have_text(types)

        legend = monitor.locator(".legend")
        for told in ("goal 4.10", "words on", "line", "robot gentle", "feedback type Binary"):
            expect(legend).to_contain_text(told)
        monitor.locator("[data-main]").click()
        expect(monitor.locator("[data-alarm=why]")).to_have_text("Paused by the therapist.")
        expect(tablet.locator(".sub")).to_contain_text("Walk until the belt stops.")
        expect(monitor.locator("[data-presence=source]")).to_contain_text("✓ 14 of 14 valid")


def steer_the_robot(server: Server, walk: Walk, monitor: Page) -> None:
    more = monitor.locator(".controls summary")  # its panel lies before the robot's
    more.click()
    pressed(monitor, "data-levels", "0.5")
    monitor.get_by_label("Celebrate later").click()
    expect(monitor.locator("[data-show=threshold]")).to_have_text("95 %")
    more.click()


def test_words_edited_in_the_admin_are_on_the_tablet_with_the_next_step(server, browser):
    (walk,) = make_walks(server, {"valence": "positive"})
    where = "/admin/rehab/feedbacktype/"
    with pages(browser, server, walk, where) as (tablet, admin), feet_of(server, walk) as feet:
        tablet.locator("[data-change=start]").click()
        feet.hear("start")
        feet.walk(1.15)
        at_step(tablet, 1)
        expect(tablet.locator(".words")).to_have_text("Above goal!")

        expect(admin.locator(".feedback-types tbody tr")).to_have_count(4)
        admin.get_by_role("link", name="Edit Positive").click()
        seen = admin.frame_locator(".preview iframe")
        expect(seen.locator("figure")).to_have_count(5)
        admin.fill("#id_bands-3-words_en", "Like a spring!")
        expect(seen.locator("figure").nth(3)).to_contain_text("Like a spring!")
        admin.fill("#id_hit_points", "7")
        expect(seen.locator("figure").nth(3)).to_contain_text("+7")
        admin.fill("#id_bands-2-from_percent", "101")
        expect(seen.locator(".warning")).to_contain_text("begin at 1, the goal")
        admin.fill("#id_bands-2-from_percent", "100")
        expect(seen.locator("figure")).to_have_count(5)
        admin.click("[name=_save]")
        expect(admin.locator(".feedback-types tbody tr").first).to_contain_text("edited here")

        expect(tablet.locator(".words")).not_to_have_text("Like a spring!")
        feet.walk(1.15)
        at_step(tablet, 2)
        expect(tablet.locator(".words")).to_have_text("Like a spring!")
        expect(tablet.locator(".key")).to_have_text("2")  # points are as they were set up

        admin.get_by_role("link", name="Edit Positive").click()
        admin.get_by_role("link", name="Back to the defaults").click()
        admin.get_by_role("button", name="Back to the defaults").click()
        expect(admin.locator(".feedback-types tbody tr").first).to_contain_text("default")
        feet.walk(1.15)
        at_step(tablet, 3)
        expect(tablet.locator(".words")).to_have_text("Above goal!")


def test_after_a_crash_both_pages_say_why_it_is_paused(tmp_path, browser):
    with serve(tmp_path) as server:
        (walk,) = make_walks(server, {"valence": "positive"})
        where = walk.monitor_path
        with pages(browser, server, walk, where) as (_, monitor), feet_of(server, walk) as feet:
            monitor.locator("[data-main]").click()
            feet.hear("start")
            feet.walk(1.2, 1.2)
    with serve(tmp_path) as server, pages(browser, server, walk, where) as (tablet, monitor):
        expect(monitor.locator("[data-alarm=restart]")).to_have_text(
            "The server was restarted; nothing was lost. Resume when ready."
        )
        expect(tablet.locator(".sub")).to_contain_text("Walk until the belt stops.")
        monitor.locator("[data-main]").click()
        expect(monitor.locator("[data-alarm=restart]")).to_have_count(0)
        expect(tablet.locator("body")).not_to_have_attribute("data-look", "paused")


def test_a_robot_that_waits_for_a_person_is_let_go_without_scrolling(server, browser):
    """It stands for a reason of its own, nobody has stopped it."""
    (walk,) = make_walks(server, {"valence": "positive"})
    status = STATUS | {"state": "disarmed", "gesture": None, "reason": "place_unknown"}
    with (
        pages(browser, server, walk, walk.monitor_path) as opened,
        robot_of(server, walk, "kinematic") as robot,
    ):
        robot.send(json.dumps({"type": "report", "report": status}))
        monitor = opened[1]
        button = monitor.get_by_role("button", name="Let it move")
        expect(button).to_be_visible()
        box, safety = button.bounding_box(), monitor.locator(".safety").bounding_box()
        assert box["y"] + box["height"] <= safety["y"]


def test_what_a_therapist_asks_for_without_a_network_is_told_to_be_unsent(server, browser):
    (walk,) = make_walks(server, {"valence": "positive"})
    with (
        Wire(server.port) as wire,
        pages(browser, server, walk, walk.monitor_path, wire.port) as opened,
        robot_of(server, walk) as robot,
    ):
        monitor = opened[1]
        stop = monitor.get_by_role("button", name="Stop robot")
        why, said = monitor.locator("[data-show=robot-why]"), monitor.locator(".said")
        expect(monitor.locator("[data-main]")).to_have_attribute("value", "start")

        wire.freeze()  # nothing is closed: the Wi-Fi is just gone
        stop.click()
        expect(stop).to_have_class(re.compile("asked"))
        unanswered = "The stop did not get through. Use the robot’s own switch."
        expect(why).to_have_text(unanswered)
        expect(said).to_have_text(unanswered)
        expect(stop).not_to_have_class(re.compile("asked"))

        wire.go_down()
        wire.thaw()
        expect(monitor.locator("[data-alarm=server]")).to_be_visible()
        stop.click()
        unsent = "Not sent: no connection. Use the robot’s own switch."
        expect(why).to_have_text(unsent)
        expect(said).to_have_text(unsent)
        expect(stop).not_to_have_class(re.compile("asked"))
        for control in (
            "[data-goal='1']",
            "[data-main]",
            "[data-levels] [value='0.5']",
            "[data-remark]",
        ):
            monitor.evaluate("document.querySelector('.said').textContent = ''")
            monitor.locator(control).first.click()
            expect(said).to_have_text("There is no connection. Try again in a moment.")

        wire.come_up()
        expect(monitor.locator("[data-alarm=server]")).to_have_count(0)
        expect(why).to_have_text("")
        stop.click()
        hear(robot, "stop")
        expect(why).to_have_text("It is standing still: it was stopped.")
        expect(monitor.locator(".safety .stop")).to_have_text("Robot stopped")
