"""The therapist's page at every size, in every language: safety within reach, and nothing cut."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.axe import check, go_dark
from tests.support.browsers import signed_in
from tests.support.layout import (
    CORNERS,
    LANGUAGES,
    SCREENS,
    boxes,
    complaints,
    cut,
    from_right_to_left,
    set_screen,
    too_small,
)
from tests.support.servers import Server
from tests.support.walk_seed import feet_of, make_walks, robot_of

pytestmark = pytest.mark.browser

SAFETY = ".safety button"
LAPTOPS = ("tablet-landscape", "low-laptop", "laptop", "wall")  # everything at once
PHASES = [
    {"kind": "baseline", "name": "Baseline", "strides": 5},
    {"kind": "training", "name": "Training", "seconds": 300},
    {"kind": "washout", "name": "Washout", "seconds": 60},  # the longest word in German
    {"kind": "catch", "name": "Catch"},
]


@pytest.fixture(scope="module", params=LANGUAGES)
def monitor(request: pytest.FixtureRequest, server: Server, browser: Browser) -> Iterator[Page]:
    """The page of a session that runs, with a robot, a goal that was changed and a note."""
    (walk,) = make_walks(server, {"name": "Rosalinda", "phases": PHASES})
    with (
        signed_in(browser, server, walk, reduced_motion="reduce") as context,
        feet_of(server, walk) as feet,
        robot_of(server, walk),
    ):
        page = context.new_page()
        page.goto("/account/")
        page.select_option("#language", request.param)
        page.click("form[action*=language] button")
        page.goto(walk.monitor_path)
        page.wait_for_selector(".readiness li")
        for screen in CORNERS:
            set_screen(page, screen)
            nothing_is_cut_or_too_small(page)
            safety_is_within_reach(page)
        page.click("[data-main]")
        feet.hear("start")
        feet.walk(0.9, 1.1, 1.0, 0.8, 1.2, 1.0, None, 1.3)
        page.click("[data-goal='1']")
        page.click("[data-remark=pain]")
        page.click("dialog[open] button[value='3']")
        feet.walk(1.1)
        expect(page.locator("[data-show=number]")).to_contain_text("9")
        yield page


def safety_is_within_reach(page: Page) -> None:
    assert complaints(page, SAFETY, 44) == []


def nothing_overlaps_below_three_alarms(page: Page) -> None:
    page.evaluate(
        """() => {
          const third = document.querySelector("[data-alarm]").cloneNode(true);
          third.classList.add("third");
          document.querySelector(".alarms").append(third);
          document.querySelector(".coach").hidden = false;
        }"""
    )
    expect(page.locator(".coach")).to_be_visible()
    assert complaints(page, ".panels .card, .remarks button", 44) == []
    page.evaluate("document.querySelector('.third').remove()")


def nothing_is_cut_or_too_small(page: Page) -> None:
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert (
        cut(page, ".card:not(.strip), .bar-top, .whom, .phases li, .seg, .notices *, .next-phase *")
        == []
    )
    assert cut(page, ".panels button, .panels select, .bar-top .btn, .panels h2") == []
    assert too_small(page, ".panels button, .panels select, .bar-top .btn", 44) == []


@pytest.mark.parametrize("screen", CORNERS)
def test_pause_stop_and_fall_keep_their_places_whatever_happens(monitor: Page, screen: str) -> None:
    set_screen(monitor, screen)
    if monitor.locator("[data-main]").get_attribute("value") == "resume":
        monitor.click("[data-main]")
    expect(monitor.locator("[data-main]")).to_have_attribute("value", "pause")
    places = boxes(monitor, SAFETY)
    assert len(places) == 3
    safety_is_within_reach(monitor)

    monitor.locator(".panels").evaluate("(panels) => panels.scrollTo(0, 9999)")
    safety_is_within_reach(monitor)
    monitor.wait_for_selector("[data-alarm=source]")  # the sensor is silent
    monitor.click("[data-main]")
    expect(monitor.locator("[data-main]")).to_have_attribute("value", "resume")
    monitor.click("[data-robot=stop]")
    monitor.wait_for_selector("[data-alarm=robot]")
    if screen in LAPTOPS:
        assert cut(monitor, ".controls, .side, .last") == []
        nothing_overlaps_below_three_alarms(monitor)
    monitor.evaluate("document.querySelector('.said').textContent = 'x '.repeat(80)")
    safety_is_within_reach(monitor)
    for question in ("[data-end]", "[data-remark=borg]"):
        monitor.click(question)
        expect(monitor.locator("dialog[open]")).to_be_visible()
        safety_is_within_reach(monitor)
        assert complaints(monitor, "dialog[open] button", 44) == []
        assert cut(monitor, "dialog[open] :is(h2, p, button)") == []
        monitor.keyboard.press("Escape")
        expect(monitor.locator("dialog[open]")).to_have_count(0)
    assert boxes(monitor, SAFETY) == places
    monitor.click("[data-fall]")
    safety_is_within_reach(monitor)
    assert cut(monitor, "[data-alarm=fall], [data-alarm=fall] *") == []
    monitor.click("[data-alarm=fall] .seen")
    answer = monitor.locator("[data-severity] button").first
    expect(answer).to_be_visible()
    safety_is_within_reach(monitor)
    assert complaints(monitor, "[data-severity] button", 44) == []
    assert cut(monitor, "[data-alarm=seen] :is(li, b, button)") == []
    answer.click()
    expect(monitor.locator(".controls")).not_to_have_attribute("inert", "")
    assert cut(monitor, "[data-alarm=seen], [data-alarm=seen] *") == []
    assert boxes(monitor, SAFETY) == places

    # The walk goes on, and what was asked is gone.
    for then in ("pause", "resume"):
        monitor.click("[data-main]")
        expect(monitor.locator("[data-main]")).to_have_attribute("value", then)
    monitor.click("[data-robot=arm]")
    monitor.evaluate("document.querySelector('.said').textContent = ''")
    expect(monitor.locator("[data-alarm]:not([data-alarm=why], [data-alarm=seen])")).to_have_count(
        0
    )


@pytest.mark.parametrize("screen", CORNERS)
def test_nothing_is_cut_or_too_small(monitor: Page, screen: str) -> None:
    set_screen(monitor, screen)
    nothing_is_cut_or_too_small(monitor)
    if screen in LAPTOPS:
        assert cut(monitor, ".panels, .controls, .side") == []
        assert complaints(monitor, ".panels .card", 44) == []
        monitor.click(".controls summary")
        assert cut(monitor, ".controls, .controls .card") == []
        monitor.click(".controls summary")
        monitor.evaluate("document.querySelector('.coach').hidden = false")
        assert complaints(monitor, ".panels .card, .remarks button", 44) == []
    if screen == "wall":  # as large, in its share of the screen, as on a laptop
        (pause, *_others) = boxes(monitor, SAFETY)
        assert pause["height"] >= 0.08 * SCREENS["wall"][1]


def test_a_phone_has_what_matters_first(monitor: Page) -> None:
    set_screen(monitor, "phone")
    parts = (".last", ".goal.card", ".strip", "[data-write]", ".presence", ".robot.card")
    tops = [boxes(monitor, part)[0]["y"] for part in parts]
    assert tops == sorted(tops)
    monitor.locator(".panels").evaluate("(panels) => panels.scrollTo(0, 0)")
    (bar,) = boxes(monitor, ".safety")
    for part in (".last", ".hits", ".goal.card", "[data-write]"):
        (box,) = boxes(monitor, part)
        assert box["y"] + box["height"] <= bar["y"]


@pytest.mark.parametrize("screen", CORNERS)
def test_nothing_breaks_from_right_to_left(monitor: Page, screen: str) -> None:
    set_screen(monitor, screen)
    with from_right_to_left(monitor):
        safety_is_within_reach(monitor)
        nothing_is_cut_or_too_small(monitor)


@pytest.mark.long
@pytest.mark.parametrize("screen", ["phone", "laptop", "wall"])
def test_axe_finds_nothing_light_and_dark(monitor: Page, screen: str) -> None:
    set_screen(monitor, screen)
    monitor.evaluate("delete document.documentElement.dataset.theme")
    monitor.wait_for_selector("html:not([data-pt=dark])")
    check(monitor)
    go_dark(monitor)
    check(monitor)


def test_of_two_on_a_phone_each_keeps_what_is_to_be_tapped_after_a_fall(
    server: Server, browser: Browser
) -> None:
    walks = make_walks(server, {"name": "Iris"}, {"name": "Tom"})
    with signed_in(browser, server, walks[0], "phone", reduced_motion="reduce") as context:
        page = context.new_page()
        page.goto(f"/sessions/two/?of={walks[0].session}&of={walks[1].session}")
        frame = page.frame_locator("iframe").first
        frame.locator("[data-fall]").click()
        expect(frame.locator("[data-alarm=fall]")).to_be_visible()
        page.keyboard.press("Escape")
        other = page.frame_locator("iframe").nth(1).locator("[data-main]")
        for button in (frame.locator("[data-alarm=fall] .seen"), other):
            expect(button).to_be_in_viewport(ratio=1)
        expect(page.locator(".elsewhere")).to_be_empty()  # its own page tells it
